"""Tables and figures of the study."""

from collections.abc import Callable, Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from agents import in_brackets, markdown_table
from studies.limits.study import (
    BANKS,
    BEAM,
    GEOMETRIC,
    IMM,
    LATER,
    THRESHOLD,
    TIMES,
    Row,
)


def markdown(parts: Mapping[str, Sequence[Row]]) -> str:
    """Return all tables of a study, see `calls`; of the steps one for each environment or law."""
    gain = "Mean reward {}; in brackets the gain over the row before, with its 95 % interval."
    if "rules" not in parts:
        # That of the IMM.
        right = [row for row in parts["steps"] if row["step"] != THRESHOLD]
        tables: list[tuple[str, Sequence[Row], Callable[[Row], str]]] = [
            (gain.format("of a tick at the tuned threshold"), parts["steps"], _gain_cell),
            (
                (
                    "Mean delay of a switch in ticks (one that is not detected counts until the end"
                    " of its segment) / wrong changes of the statement per 1,000 ticks, at the same"
                    " thresholds."
                ),
                parts["steps"],
                _delay_cell,
            ),
            (
                (
                    "Share of ticks at which the most probable mode is the true one, %, without a"
                    " threshold."
                ),
                right,
                lambda row: in_brackets(row["most_probable_right"], 1, 100.0),
            ),
        ]
        return _sections("HybridTrackQuickest-v0, durations {}", "law", ["step"], tables)
    times = (
        "Mean decision time in ticks at 95 % / at 98 % accuracy; mean reward per segment at the"
        " best threshold."
    )
    steps = (gain.format("per segment"), parts["steps"], _gain_cell)
    rules = (times, parts["rules"], _times_cell)
    calibration = (
        "### Calibration of the banks: accuracy / mean posterior of the most probable hypothesis,"
        " %\n\nHybridTrackPublished-v0, no decisions; in brackets the largest calibration error"
        " (mean posterior minus accuracy in a bin of the posterior).\n\n"
    )
    cells: dict[tuple[str, str], list[str]] = {}
    for row in parts["calibration"]:
        worst = "-" if row["worst"] is None else f"{100 * row['worst']:+.1f}"
        cell = f"{100 * row['right']:.1f} / {100 * row['stated']:.1f} ({worst})"
        cells.setdefault((row["bank"], f"{row['noise']:g}"), []).append(cell)
    ticks = dict.fromkeys(f"after {row['ticks']} ticks" for row in parts["calibration"])
    calibration += markdown_table(
        ("bank", "R", *ticks),
        [(*key, *texts) for key, texts in cells.items()],
    )
    accuracy = [
        (
            _name(row["bank"]),
            f"{row['noise']:g}",
            in_brackets(row["accuracy"], 1, 100.0),
            f"{row['ticks']:.1f}",
        )
        for row in parts["golubkov2018"]
    ]
    scheme = "### The gap rule at ln 99 on the scheme of Golubkov 2018\n\n"
    scheme += markdown_table(("bank", "R", "type accuracy, %", "mean ticks"), accuracy)
    bound = _sections(
        "From ATE to the bound on {}",
        "env_id",
        ["step"],
        [steps],
    )
    return "\n".join(
        [
            bound,
            _sections("{}", "env_id", ["bank", "rule"], [rules]),
            calibration,
            scheme,
        ]
    )


def _sections(
    title: str,
    place: str,
    names: Sequence[str],
    tables: Sequence[tuple[str, Sequence[Row], Callable[[Row], str]]],
) -> str:
    """Return a section for each place, with tables of cells of rows below their text; noise
    levels are in columns.
    """
    noises = sorted({row["noise"] for row in tables[0][1]})
    heads = [*names, *(f"R = {noise:g}" for noise in noises)]
    parts = []
    for where in dict.fromkeys(row[place] for row in tables[0][1]):
        parts.append(f"### {title.format(where)}\n")
        for text, rows, cell in tables:
            lines: dict[tuple[str, ...], list[str]] = {}
            for row in sorted(rows, key=lambda row: noises.index(row["noise"])):
                if row[place] == where:
                    key = tuple(_name(row[name]) if name == "bank" else row[name] for name in names)
                    lines.setdefault(key, []).append(cell(row))
            parts += [
                f"{text}\n",
                markdown_table(heads, [(*name, *cells) for name, cells in lines.items()]),
            ]
    return "\n".join(parts)


def _name(bank: str) -> str:
    return bank.replace("_", "-")


def _gain_cell(row: Row) -> str:
    reward = f"{row['reward'].value:.3f}"
    gain = row["gain"]
    return reward if gain is None else f"{reward} ({in_brackets(gain, 3, sign='+')})"


def _delay_cell(row: Row) -> str:
    delay = row["delay"].value
    wrong = row["wrong_changes"].value
    return f"{f'{delay:.1f}' if np.isfinite(delay) else '-'} / {wrong:.2f}"


def _times_cell(row: Row) -> str:
    return (
        f"{' / '.join(in_brackets(row[time], 1) for time in TIMES)};"
        f" {in_brackets(row['reward'], 3)}"
    )


def figure(parts: Mapping[str, Sequence[Row]]) -> Figure:
    """Return the figure of a study, see `calls`."""
    return decision_times(parts["rules"]) if "rules" in parts else later_ticks(parts["steps"])


def decision_times(rows: Sequence[Row]) -> Figure:
    """Draw the mean decision time at 98 % accuracy over the noise, one row per environment, one
    column per bank.

    Rules that do not reach 98 % at a noise level are above the dashed line at the top. Coinciding
    lines remain visible, as the last is dashed and markers become smaller.
    """
    places = list(dict.fromkeys(row["env_id"] for row in rows))
    canvas, grid = plt.subplots(
        len(places),
        len(BANKS),
        figsize=(13.0, 3.9 * len(places)),
        sharex=True,
        sharey="row",
        squeeze=False,
        layout="constrained",
    )
    for place, line in zip(places, grid, strict=True):
        here = [row for row in rows if row["env_id"] == place]
        times = [row["time_98"].value for row in here if np.isfinite(row["time_98"].value)]
        top = 5.0 * float(np.ceil(max(times, default=10.0) / 5.0))
        ticks = np.arange(0.0, top + 1.0, 10.0)
        names = list(dict.fromkeys(row["rule"] for row in here))
        for bank, axes in zip(BANKS, line, strict=True):
            for index, name in enumerate(names):
                curve = [row for row in here if (row["bank"], row["rule"]) == (bank, name)]
                axes.plot(
                    [row["noise"] for row in curve],
                    [min(row["time_98"].value, 1.09 * top) for row in curve],
                    "o--" if name == names[-1] else "o-",
                    markersize=8.5 - 1.3 * index,
                    label=name,
                )
            axes.axhline(
                1.03 * top,
                color="0.75",
                linewidth=0.8,
                linestyle="--",
                zorder=0,
            )
            axes.set(title=f"{place}, {_name(bank)} bank", xscale="log", ylim=(0.0, 1.15 * top))
            axes.set_yticks(
                [*ticks, 1.09 * top],
                labels=[*map("{:g}".format, ticks), "not reached"],
            )
        line[0].set_ylabel("mean decision time\nat 98 % accuracy, ticks")
        line[-1].legend(frameon=False)
    canvas.supxlabel("measurement variance R, m²")
    return canvas


def later_ticks(rows: Sequence[Row]) -> Figure:
    """Draw the mean reward of a tick against the later ticks known, one row per law, one column
    per noise level.

    The curve of the beam that knows the law begins with its reward on line. The other lines are the
    rules below it, dotted without a threshold. Bars are 95 % confidence intervals.
    """
    laws, noises = (sorted({row[key] for row in rows}) for key in ("law", "noise"))
    canvas, grid = plt.subplots(
        len(laws),
        len(noises),
        figsize=(13.0, 3.7 * len(laws)),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    lags = [0, *LATER]
    for law, line in zip(laws, grid, strict=True):
        for noise, axes in zip(noises, line, strict=True):
            here = [row for row in rows if (row["law"], row["noise"]) == (law, noise)]
            rewards = {row["step"]: row["reward"] for row in here}
            known = [rewards[step] for step in (BEAM, *LATER.values())]
            values = np.array([reward.value for reward in known])
            bars = [
                values - [reward.low for reward in known],
                [reward.high for reward in known] - values,
            ]
            axes.errorbar(
                lags,
                values,
                bars,
                marker="o",
                label=BEAM,
            )
            for step, style in (
                (GEOMETRIC, "C1--"),
                (THRESHOLD, "C2--"),
                (IMM, "C2:"),
            ):
                axes.plot(
                    lags[:: len(lags) - 1],
                    [rewards[step].value] * 2,
                    style,
                    label=step,
                )
            axes.set_title(f"durations {law}, R = {noise:g} m²", fontsize=10)
    grid[0, -1].legend(frameon=False)
    canvas.supxlabel("later ticks known")
    canvas.supylabel("mean reward of a tick")
    return canvas
