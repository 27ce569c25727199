"""Tables, JSON and picture of the comparison on flights of gliders."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import bounds_cell, filled_table
from agents.evaluation.gliders import METRICS, glider_rule
from agents.figures.tracks import recording_figure
from agents.studies.comparison import finite
from agents.studies.flights_report import figure_cell
from agents.studies.gliders_gap import SHARES, gap_table
from agents.studies.gliders_study import LEVELS, GliderComparison
from baselines.recordings.flights.labels import MODE_NAMES
from baselines.recordings.flights.metrics import STATISTICS
from baselines.scoring.estimates import Estimate

SHOWN = 600.0  # time in the picture [s]
NOTE = (
    "Second lines: 95 % interval, flights drawn with replacement. Less first: points of agreement.\n"
    "Settings: the best agreement on the other half with as few false changes there.\n"
    "Enter, leave: mean time from a change of the label to the first right statement.\n"
    "Misses: the next change of the label came first. Simul.: agreement on simulated flights."
)


def glider_tables(result: GliderComparison) -> list[Table]:
    """Return the tables of each level, for the open logs and for the sealed ones, and of the simulated flights."""
    return [*(_table(result, group, level) for group in result.groups for level in LEVELS), gap_table(result.gap)]


def _table(result: GliderComparison, group: str, level: float) -> Table:
    rows, lines = result.groups[group], []
    hours = sum(float(result.labels[k].weights.sum()) for k in rows) / 3600.0
    for name, scores in result.scores[level].items():
        less = difference(result, level, name, rows)
        cells = [figure_cell(scores.some(rows), metric) for metric in METRICS]
        cells.append("" if less is None else bounds_cell(less, 1, 100.0))
        cells.append(f"{100.0 * float(result.simulated[level][name].curve(STATISTICS['agreement'])[0]):.1f}")
        lines.append((escape(glider_rule(name).title), *cells))
    heads = ("decider", *(metric.head for metric in METRICS), "less\nfirst", "simul.\n%")
    title = f"{len(rows)} flights of gliders, {group}, {hours:.1f} h: at most {level:g} false an hour"
    return filled_table(title, heads, lines, NOTE if level == LEVELS[-1] else "")


def difference(result: GliderComparison, level: float, name: str, rows: list[int]) -> Estimate | None:
    """Return the agreement of a rule on some flights less that of the first rule; None for that one."""
    by_name = result.scores[level]
    first = next(iter(by_name))
    if name == first:
        return None
    return by_name[name].some(rows).difference(by_name[first].some(rows), STATISTICS["agreement"])


def gliders_json(result: GliderComparison) -> dict[str, Any]:
    """Contents of the tables, the settings, the figures of every flight, and the seal."""
    groups: dict[str, Any] = {}
    for group, rows in result.groups.items():
        for level, by_name in result.scores.items():
            for name, scores in by_name.items():
                some = scores.some(rows)
                figures: dict[str, Any] = {one.name: some.estimate(one.statistic).as_json() for one in METRICS}
                less = difference(result, level, name, rows)
                figures["agreement_less_first"] = None if less is None else less.as_json()
                figures["settings"] = result.chosen[level][name]
                copied = result.simulated[level][name]
                figures["simulated"] = {one.name: copied.estimate(one.statistic).as_json() for one in METRICS}
                groups.setdefault(group, {}).setdefault(f"{level:g}", {})[name] = figures
    flights = [
        {
            "id": flight.identity,
            "half": flight.tier.name,
            "hours": flight.hours,
            "scored_hours": float(labels.weights.sum()) / 3600.0,
            "circles": sum(mode != 0 for *_, mode in labels.pieces),
            "deciders": {
                name: {one.name: finite(scores.some([k]).curve(one.statistic)[0]) for one in METRICS}
                for name, scores in result.scores[LEVELS[1]].items()
            },
        }
        for k, (flight, labels) in enumerate(zip(result.flights, result.labels, strict=True))
    ]
    return {"groups": groups, "flights": flights, "gap": {"percentiles": SHARES, **result.gap}, "seal": result.seal}


def glider_figure(result: GliderComparison) -> Figure:
    """The ten minutes with most changes of the flight with the median agreement of the first rule."""
    first, scores = next(iter(result.scores[LEVELS[1]].items()))
    each = [float(scores.some([k]).curve(STATISTICS["agreement"])[0]) for k in range(len(result.flights))]
    k = int(np.argsort(each)[len(each) // 2])
    flight, labels = result.flights[k], result.labels[k]
    ends = np.searchsorted(flight.times, flight.times + SHOWN)
    changes = np.cumsum(np.diff(labels.modes, prepend=labels.modes[0]) != 0)
    first_row = int((changes[ends - 1] - changes).argmax())
    rows = slice(first_row, ends[first_row])
    shown = np.where(labels.scored, labels.modes, len(MODE_NAMES))[rows]
    minutes = (flight.times[rows] - flight.times[first_row]) / 60.0
    stated = {glider_rule(name).title: one[k][rows] for name, one in result.stated.items()}
    title = f"{flight.identity}: {glider_rule(first).title} agrees {each[k]:.1%} of the whole flight"
    kilometres = flight.positions[rows] / 1000.0
    return recording_figure(kilometres, minutes, [(0, len(minutes))], shown, stated, MODE_NAMES, title)
