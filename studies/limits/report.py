"""Tables and figure of the study."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.limits.study import BANKS, Row
from studies.results import in_brackets, markdown_table


def markdown(parts: Mapping[str, Sequence[Row]]) -> str:
    """Return all tables of a study by its parts; of the steps one for each environment or law."""
    gain = (
        "Mean reward per segment, with unknown moments of a tick, at the tuned threshold; in"
        " brackets the gain over the row before, with its 95 % interval."
    )
    below = (
        "Mean reward per segment at the tuned threshold; in brackets the gain over the bound, with"
        " its 95 % interval."
    )
    times = (
        "Mean decision time in ticks at 95 % / at 98 % accuracy; mean reward per segment at the"
        " best threshold."
    )
    by_noise = "R = {:g}"
    text = []
    if "bound" in parts:
        for place, here in pd.DataFrame(parts["bound"]).groupby("place", sort=False):
            cells = _pivot(here, ["step", "noise"], by_noise, _gain_cell)
            text += [f"### The bound: {place}\n", f"{below}\n", cells]
    if "steps" not in parts:
        return "\n".join(text)
    for place, here in pd.DataFrame(parts["steps"]).groupby("place", sort=False):
        text += [f"### Steps of information: {place}\n", f"{gain}\n"]
        text += [_pivot(here, ["step", "noise"], by_noise, _gain_cell)]
    if "rules" not in parts:
        return "\n".join(text)
    for env_id, here in pd.DataFrame(parts["rules"]).groupby("env_id", sort=False):
        here = here.assign(bank=here.bank.str.replace("_", "-"))
        text += [
            f"### {env_id}\n",
            f"{times}\n",
            _pivot(here, ["bank", "rule", "noise"], by_noise, _times_cell),
        ]
    calibration = pd.DataFrame(parts["calibration"])
    calibration["R"] = calibration.noise.map("{:g}".format)
    text += [
        "### Calibration of the banks: accuracy / mean posterior of the most probable hypothesis,"
        " %\n",
        "HybridTrackPublished-v0, no decisions; in brackets the largest calibration error (mean"
        " posterior minus accuracy in a bin of the posterior).\n",
        _pivot(calibration, ["bank", "R", "ticks"], "after {} ticks", _calibration_cell),
    ]
    return "\n".join(text)


def _pivot(rows: pd.DataFrame, names: list[str], head: str, cell: Callable[[Row], str]) -> str:
    """Return a table of cells of rows, with values of the last name in columns below a head."""
    rows = rows.assign(cell=[cell(row) for row in rows.to_dict("records")])
    table = rows.set_index(names).cell.unstack(sort=False).rename(columns=head.format)
    table = table.reset_index()
    return markdown_table(list(table), table.itertuples(index=False))


def _calibration_cell(row: Row) -> str:
    worst = "-" if np.isnan(row["worst"]) else f"{100 * row['worst']:+.1f}"
    return f"{100 * row['right']:.1f} / {100 * row['stated']:.1f} ({worst})"


def _gain_cell(row: Row) -> str:
    gain = row["gain"]
    if gain is None:
        return in_brackets(row["reward"], 3)
    return f"{row['reward'].value:.3f} ({in_brackets(gain, 3, sign='+')})"


def _times_cell(row: Row) -> str:
    times = " / ".join(in_brackets(row[time], 1) for time in ("time_95", "time_98"))
    return f"{times}; {in_brackets(row['reward'], 3)}"


def figure(rows: Sequence[Row]) -> Figure:
    """Draw the mean decision time at 98 % accuracy over the noise, one row per environment, one
    column per bank; a rule has no point where it does not reach 98 %.

    Coinciding lines remain visible, as the last is dashed and markers become smaller.
    """
    frame = pd.DataFrame(rows).assign(time=[row["time_98"].value for row in rows])
    frame = frame.replace(np.inf, np.nan)
    places = frame.env_id.unique()
    size = 13.0, 3.9 * len(places)
    canvas = Figure(figsize=size, layout="constrained")
    grid = canvas.subplots(len(places), len(BANKS), sharex=True, sharey="row", squeeze=False)
    for (place, bank), axes in zip(product(places, BANKS), grid.flat, strict=True):
        here = frame[(frame.env_id == place) & (frame.bank == bank)]
        curves = [*here.groupby("rule", sort=False)]
        for index, (name, curve) in enumerate(curves):
            line = "o--" if index == len(curves) - 1 else "o-"
            axes.plot(curve.noise, curve.time, line, markersize=8.5 - 1.3 * index, label=name)
        title = f"{place}, {bank.replace('_', '-')} bank"
        axes.set(title=title, xscale="log", ylim=(0.0, None))
    for line in grid:
        line[0].set_ylabel("mean decision time\nat 98 % accuracy, ticks")
        line[-1].legend(frameon=False)
    canvas.supxlabel("measurement variance R, m²")
    return canvas
