"""Tables, JSON and picture of the comparison on flights of gliders."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import filled_table
from agents.evaluation.gliders import METRICS, glider_rule
from agents.figures.tracks import recording_figure
from agents.studies.comparison import finite
from agents.studies.flights_report import figure_cell, less_cell, less_first, value
from agents.studies.gliders_study import LEVELS, SHARES, GliderComparison
from baselines.recordings.flights.labels import MODE_NAMES
from baselines.scoring.scores import Scores

SHOWN = 600.0  # time in the picture [s]
NOTE = (
    "Second lines: 95 % interval, flights drawn with replacement. Less first: points of agreement.\n"
    "Settings: the best agreement on the other half with as few false changes there.\n"
    "Enter, leave: mean time from a change of the label to the first right statement.\n"
    "Misses: the next change of the label came first. Simul.: agreement on simulated flights."
)


def glider_tables(result: GliderComparison) -> list[Table]:
    """Return the tables of each level, for the open logs and for the sealed ones, and of the simulated flights."""
    return [*(_table(result, group, level) for group in result.groups for level in LEVELS), _gap_table(result)]


def _table(result: GliderComparison, group: str, level: float) -> Table:
    rows, lines = result.groups[group], []
    hours = sum(float(result.labels[k].weights.sum()) for k in rows) / 3600.0
    for name, scores in result.scores[level].items():
        cells = [figure_cell(scores.some(rows), metric) for metric in METRICS]
        cells.append(less_cell(less_first(result.scores[level], name, rows)))
        lines.append((escape(glider_rule(name).title), *cells, f"{100.0 * value(result.simulated[level][name]):.1f}"))
    heads = ("decider", *(metric.head for metric in METRICS), "less\nfirst", "simul.\n%")
    title = f"{len(rows)} flights of gliders, {group}, {hours:.1f} h: at most {level:g} false an hour"
    return filled_table(title, heads, lines, NOTE if level == LEVELS[-1] else "")


def _gap_table(result: GliderComparison) -> Table:
    """Return the table of percentiles, of logs and of simulated flights."""
    lines = [(name, *(f"{one:.2f}" for side in sides for one in side)) for name, sides in result.gap.items()]
    heads = ("", *(f"{source}\n{share:g} %" for source in ("logs", "simul.") for share in SHARES))
    return filled_table("Open logs and simulated flights: percentiles", heads, lines)


def gliders_json(result: GliderComparison) -> dict[str, Any]:
    """Contents of the tables, the settings, the figures of every flight, and the seal."""
    groups: dict[str, Any] = {}
    for group, rows in result.groups.items():
        for level, by_name in result.scores.items():
            for name, scores in by_name.items():
                less, copied = less_first(by_name, name, rows), result.simulated[level][name]
                groups.setdefault(group, {}).setdefault(f"{level:g}", {})[name] = _estimates(scores.some(rows)) | {
                    "agreement_less_first": None if less is None else less.as_json(),
                    "settings": result.chosen[level][name],
                    "simulated": _estimates(copied),
                }
    flights = [
        {
            "id": flight.identity, "half": flight.tier.name, "hours": flight.hours,
            "scored_hours": float(labels.weights.sum()) / 3600.0,
            "circles": sum(mode != 0 for *_, mode in labels.pieces),
            "deciders": {
                name: {one.name: finite(scores.some([k]).curve(one.statistic)[0]) for one in METRICS}
                for name, scores in result.scores[LEVELS[1]].items()
            },
        }
        for k, (flight, labels) in enumerate(zip(result.flights, result.labels, strict=True))
    ]  # fmt: skip
    return {"groups": groups, "flights": flights, "gap": {"percentiles": SHARES, **result.gap}, "seal": result.seal}


def _estimates(scores: Scores) -> dict[str, Any]:
    return {one.name: scores.estimate(one.statistic).as_json() for one in METRICS}


def glider_figure(result: GliderComparison) -> Figure:
    """The ten minutes with most changes of the flight with the median agreement of the first rule."""
    first, scores = next(iter(result.scores[LEVELS[1]].items()))
    each = [value(scores.some([k])) for k in range(len(result.flights))]
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
