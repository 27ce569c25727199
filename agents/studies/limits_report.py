"""Markdown tables and the figure of what limits a decision."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from agents.evaluation.announced import AnnouncedTask
from agents.evaluation.cells import in_brackets, markdown_table
from agents.evaluation.unknown import UnknownTask
from agents.figures.curves import Axis, Curve, Panel, curve_figure, error_bars
from agents.figures.decider_colours import decider_styles
from agents.studies.limits import BANKS, BEAM, GEOMETRIC, IMM, LATER, LAWS, NOISE_LEVELS, THRESHOLD, TIMES, Limit, gains
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import mean
from baselines.scoring.statements import STATISTICS

Row = tuple[Limit, Estimate | None]
Cell = Callable[[Limit, Estimate | None], str]


def limits_markdown(parts: Mapping[str, Sequence[Any]]) -> str:
    """Return all tables of a study, see `limits.calls`; of the steps one for each environment or law."""
    if "rules" not in parts:
        tables: dict[str, Cell] = {
            "Mean reward of a tick at the tuned threshold; in brackets the gain over the row before, with its "
            "95 % interval.": _gain_cell,
            "Mean delay of a switch in ticks (one that is not detected counts until the end of its segment) / "
            "wrong changes of the statement per 1,000 ticks, at the same thresholds.": _delay_cell,
            "Share of ticks at which the most probable mode is the true one, %, without a threshold.": _right_cell,
        }
        return _sections("HybridTrackQuickest-v0, durations {}", gains(parts["steps"], UnknownTask), tables)
    reward = "Mean reward per segment; in brackets the gain over the row before, with its 95 % interval."
    times = "Mean decision time in ticks at 95 % / at 98 % accuracy; mean reward per segment at the best threshold."
    rules: list[Row] = [(one, None) for one in parts["rules"]]
    return "\n".join(
        [
            _sections("From ATE to the bound on {}", gains(parts["steps"], AnnouncedTask), {reward: _gain_cell}),
            _sections("{}", rules, {times: _times_cell}, "bank | rule"),
            _calibration_markdown(parts["calibration"]), _type_accuracy_markdown(parts["golubkov2018"]),
        ]
    )  # fmt: skip


def _calibration_markdown(found: Sequence[Mapping[str, Any]]) -> str:
    """Return accuracy and mean posterior by bank, noise level and tick."""
    rows: dict[tuple[str, str], list[str]] = {}
    for one in found:
        worst = "-" if one["worst"] is None else f"{100 * one['worst']:+.1f}"
        cell = f"{100 * one['right']:.1f} / {100 * one['stated']:.1f} ({worst})"
        rows.setdefault((one["bank"], f"{one['noise']:g}"), []).append(cell)
    heads = ("bank", "R", *dict.fromkeys(f"after {one['ticks']} ticks" for one in found))
    return (
        "### Calibration of the banks: accuracy / mean posterior of the most probable hypothesis, %\n\n"
        "HybridTrack-v0, no decisions; in brackets the largest calibration error (mean posterior minus "
        "accuracy in a bin of the posterior).\n\n"
        + markdown_table(heads, [(*key, *cells) for key, cells in rows.items()])
    )


def _type_accuracy_markdown(found: Sequence[Limit]) -> str:
    """Return the type accuracy of the gap rule on the scheme of Golubkov 2018."""
    rows = []
    for one in found:
        accuracy = in_brackets(one.scores.estimate(mean("type_accuracy", share=True)), 1, 100.0)
        ticks = float(one.scores.curve(mean("ticks"))[0])
        rows.append((one.bank.replace("_", "-"), f"{one.noise:g}", accuracy, f"{ticks:.1f}"))
    heads = ("bank", "R", "type accuracy, %", "mean ticks")
    return "### The gap rule at ln 99 on the scheme of Golubkov 2018\n\n" + markdown_table(heads, rows)


def _sections(title: str, rows: Sequence[Row], tables: Mapping[str, Cell], head: str = "step") -> str:
    """Return a section for each place, with tables of cells by their text; noise levels are in columns."""
    heads = [*head.split(" | "), *(f"R = {noise:g}" for noise in NOISE_LEVELS)]
    parts = []
    for place in dict.fromkeys(one.place for one, _ in rows):
        parts.append(f"### {title.format(place.rpartition(':')[2])}\n")
        for text, cell in tables.items():
            lines: dict[tuple[str, ...], list[str]] = {}
            for one, gain in sorted(rows, key=lambda row: NOISE_LEVELS.index(row[0].noise)):
                if one.place == place and (cell is not _right_cell or one.row != THRESHOLD):
                    name = (one.bank.replace("_", "-"), one.row) if one.bank else (one.row,)
                    lines.setdefault(name, []).append(cell(one, gain))
            parts += [f"{text}\n", markdown_table(heads, [(*name, *cells) for name, cells in lines.items()])]
    return "\n".join(parts)


def _gain_cell(one: Limit, gain: Estimate | None) -> str:
    reward = float(one.scores.curve(mean("reward"))[0])
    return f"{reward:.3f}" if gain is None else f"{reward:.3f} ({in_brackets(gain, 3, sign='+')})"


def _delay_cell(one: Limit, gain: Estimate | None) -> str:
    delay, wrong = (float(one.scores.curve(STATISTICS[name])[0]) for name in ("full_delay", "wrong_changes"))
    return f"{f'{delay:.1f}' if np.isfinite(delay) else '-'} / {wrong:.2f}"


def _right_cell(one: Limit, gain: Estimate | None) -> str:
    assert one.curve is not None
    return in_brackets(one.curve.estimate(STATISTICS["right"]), 1, 100.0)


def _times_cell(one: Limit, gain: Estimate | None) -> str:
    assert one.curve is not None
    times = " / ".join(in_brackets(one.curve.estimate(time), 1) for time in TIMES.values())
    return f"{times}; {in_brackets(one.scores.estimate(mean('reward')), 3)}"


WIDTH = 11.5  # of a figure [in]
# labels, which are the names of the deciders in other figures
NAMES = {IMM: "IMM", THRESHOLD: "IMM threshold", GEOMETRIC: "beam, geometric", BEAM: "beam"}


def limits_figure(parts: Mapping[str, Sequence[Any]]) -> Figure:
    """Return the figure of a study, see `limits.calls`."""
    return decision_times(parts["rules"]) if "rules" in parts else later_ticks(parts["steps"])


def decision_times(found: Sequence[Limit]) -> Figure:
    """Mean decision time at 98 % accuracy over the noise, one row per environment, one column per bank.

    Rules that do not reach 98 % at a noise level have a hollow marker in the strip at the top. Coinciding lines
    remain visible, as the last is dashed.
    """
    levels = {noise: f"{noise:g}" for noise in NOISE_LEVELS}
    noise = Axis("measurement variance R, m²", (0.7 * NOISE_LEVELS[0], 1.5 * NOISE_LEVELS[-1]), levels, log=True)
    styles, rows = decider_styles(dict.fromkeys(one.row for one in found)), []
    for place in dict.fromkeys(one.place for one in found):
        times = {(one.bank, one.row, one.noise): _time(one) for one in found if one.place == place}
        top = 5.0 * float(np.ceil(max(filter(np.isfinite, times.values()), default=10.0) / 5.0))
        ticks = {tick: f"{tick:g}" for tick in np.arange(0, top + 1, 10).tolist()} | {1.09 * top: "not reached"}
        time = Axis("mean decision time\nat 98 % accuracy, ticks", (0.0, 1.15 * top), ticks, minor=True)
        rules = list(dict.fromkeys(rule for _, rule, _ in times))
        panels = []
        for bank in BANKS:
            curves = []
            for index, rule in enumerate(rules):
                own = {level: one for (*key, level), one in times.items() if key == [bank, rule]}
                style: dict[str, Any] = {"size": 8.5 - 1.3 * index, "dashes": "--" if rule == rules[-1] else "-"}
                curves.append(Curve(rule, styles[rule], [*own], [*own.values()], filled=True, width=1.8, **style))
            title = f"{place.rpartition(':')[2]}, {bank.replace('_', '-')} bank"
            panels.append(Panel(title, noise, time, curves, (1.03 * top, 1.09 * top)))
        rows.append(panels)
    return curve_figure(rows, (WIDTH, 3.9 * len(rows)), title_size=11.0, sharex=True, sharey="row")


def _time(one: Limit) -> float:
    """Mean decision time at 98 % accuracy, infinite where it is not reached."""
    assert one.curve is not None
    return one.curve.estimate(TIMES["time_98"]).value


def later_ticks(found: Sequence[Limit]) -> Figure:
    """Mean reward of a tick against the later ticks known, one row per law, one column per noise level.

    The curve of the beam that knows the law begins with its reward on line. The other lines are the rules
    below it, dotted without a threshold. Bars are 95 % confidence intervals.
    """
    rows = []
    for law in LAWS:
        panels = []
        for noise in NOISE_LEVELS:
            curves = _step_curves({one.row: one for one in found if (one.place, one.noise) == (law, noise)})
            title = f"durations {law}, R = {noise:g} m²"
            panels.append(Panel(title, Axis("later ticks known"), Axis("mean reward of a tick"), curves))
        rows.append(panels)
    return curve_figure(rows, (WIDTH, 3.7 * len(LAWS)), title_size=10.0, sharex=True, sharey=True)


def _step_curves(steps: dict[str, Limit]) -> list[Curve]:
    """Return the curves of one law and noise level."""
    styles = decider_styles(NAMES.values())
    lags = [0, *LATER]
    rewards = [steps[step].scores.estimate(mean("reward")) for step in (BEAM, *LATER.values())]
    name, values = NAMES[BEAM], [one.value for one in rewards]
    curves = [Curve(name, styles[name], lags, values, bars=error_bars(rewards), size=5.0, filled=True, width=1.5)]
    for step in (GEOMETRIC, THRESHOLD, IMM):
        style = styles[NAMES[THRESHOLD if step == IMM else step]]  # the same bank
        reward = float(steps[step].scores.curve(mean("reward"))[0])
        dashes = ":" if step == IMM else "--"
        curves.append(Curve(NAMES[step], style, [lags[0], lags[-1]], [reward] * 2, size=0.0, dashes=dashes))
    return curves
