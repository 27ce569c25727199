"""Tables, JSON and pictures of the comparisons on recorded flights, of aircraft and of gliders."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import bounds_cell, filled_table
from agents.evaluation.flights import METRICS
from agents.evaluation.gliders import METRICS as GLIDER_METRICS
from agents.evaluation.gliders import glider_rule
from agents.evaluation.task import Metric
from agents.figures.tracks import recording_figure
from agents.studies.comparison import finite
from agents.studies.flights_study import POSITIONS_LATE, FlightComparison, without_stress
from agents.studies.gliders_study import LEVELS, SHARES, GliderComparison
from baselines.recordings.flights.labels import MODE_NAMES
from baselines.recordings.flights.metrics import STATISTICS
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores

SECOND_LINES = "Second lines: 95 % interval, flights drawn with replacement."
AGREEMENT = STATISTICS["agreement"]
TURNS = "false_turns_per_hour"
SHOWN = tuple(metric for metric in METRICS if metric.name != TURNS)  # in brackets after all false changes

SHOWN_TIME = 600.0  # time in the picture [s]
GLIDER_NOTE = (
    "Second lines: 95 % interval, flights drawn with replacement. Less first: points of agreement.\n"
    "Settings: the best agreement on the other half with as few false changes there.\n"
    "Enter, leave: mean time from a change of the label to the first right statement.\n"
    "Misses: the next change of the label came first. Simul.: agreement on simulated flights."
)


def flight_tables(result: FlightComparison) -> list[Table]:
    """Return the tables of a comparison."""
    tables = [_figures_table(result)]
    if len(result.names) > 1:
        tables.append(_differences_table(result))
    if result.truth is not None:
        tables += [_late_table(result, result.truth), _sensitivity_table(result)]
    return tables


def _figures_table(result: FlightComparison) -> Table:
    """Figures of each decider in each tier, with 95 % intervals over flights."""
    first = next(iter(result.scores.values()))
    hours = sum(first.of("scored", 0)[without_stress(result.flights)]) / 3600.0
    form = "" if result.truth is not None else f", {result.task.form}"
    lines: list[tuple[str, ...]] = []
    for name, rows in result.groups.items():
        for number, (decider, label) in enumerate(result.names.items()):
            cells = [figure_cell(result.scores[decider].some(rows), metric, TURNS) for metric in SHOWN]
            head = f"{name}\n({len(rows)})" if number == 0 else ""
            lines.append((head, escape(label), *cells, f"{value(result.twins[decider].some(rows)):.3f}"))
        lines.append(())
    return filled_table(
        f"{len(without_stress(result.flights))} recorded flights{form}, {hours:.1f} scored hours",
        ("tier", "decider", *(metric.head for metric in SHOWN), "twins"), lines,
        f"{SECOND_LINES}\n"
        "Twins: agreement on simulated flights with the same steps, speeds and turns.\n"
        "Delay: from a change of the label to the first right statement.\n"
        "False: a change to a mode that is not the label until the next change;\n"
        "in brackets those of them to a turn while the label is straight motion.", 2,
    )  # fmt: skip


def figure_cell(scores: Scores, metric: Metric, of_false: str = "") -> str:
    """Return a figure, and below it its interval, in few characters; after false changes some of them."""
    estimate = scores.estimate(metric.statistic)
    shown = [_short(metric.scale * one, metric.digits) for one in vars(estimate).values()]
    bracketed = of_false and metric.name == "false_per_hour"
    turns = f" ({_short(value(scores, of_false), metric.digits)})" if bracketed else ""
    return f"{shown[0]}{turns}\n{shown[1]}-{shown[2]}"


def _short(number: float, digits: int) -> str:
    """Return a number with one digit less from 10 on."""
    return f"{number:.{digits - (round(abs(number), digits) >= 10.0)}f}" if np.isfinite(number) else "-"


def value(scores: Scores, name: str = "agreement") -> float:
    """Return a figure of some flights."""
    return float(scores.curve(STATISTICS[name])[0])


def less_first(scores: Mapping[str, Scores], name: str, rows: list[int]) -> Estimate | None:
    """Return the agreement of a decider on some flights less that of the first decider; None for that one."""
    first = next(iter(scores))
    return None if name == first else scores[name].some(rows).difference(scores[first].some(rows), AGREEMENT)


def less_cell(less: Estimate | None) -> str:
    """Return what `less_first` returns in percentage points."""
    return "" if less is None else bounds_cell(less, 1, 100.0)


def _differences_table(result: FlightComparison) -> Table:
    """Paired differences of the agreement to the first decider."""
    first, *others = result.names.items()
    lines = [
        (tier, *(less_cell(less_first(result.scores, name, rows)) for name, _ in others))
        for tier, rows in result.groups.items()
    ]
    title = f"Agreement less that of {first[1]}, percentage points"
    return filled_table(title, ("tier", *(escape(label) for _, label in others)), lines, SECOND_LINES)


def _late_table(result: FlightComparison, truth: Scores) -> Table:
    """Figures of the labels, stated some positions late."""
    heads = ["tier", "truth"]
    for count in POSITIONS_LATE:
        heads += [f"{count} late:\nagreement", "delay\ns", "false\nper hour"]
    lines = []
    for tier, rows in result.groups.items():
        cells = [tier, f"{value(truth.some(rows)):.3f}"]
        for some in (late.some(rows) for late in result.late):
            cells += [f"{value(some):.3f}", *(f"{value(some, name):.1f}" for name in ("delay", "false_per_hour"))]
        lines.append(cells)
    return filled_table(
        "The labels themselves, stated late", heads, lines,
        "Late: figures of a decider that states the labels this number of positions late.\n"
        "Truth: share of the time in which labels of twins are the true modes.",
    )  # fmt: skip


def _sensitivity_table(result: FlightComparison) -> Table:
    """Effect of the settings of the labels."""
    heads = ("setting", "same", "scored", "turns", f"agreement of\n{escape(next(iter(result.names.values())))}")
    lines = [
        (one.name, f"{one.same:.3f}", f"{one.scored:.3f}", f"{one.turns}", f"{one.agreement:.3f}")
        for one in result.sensitivity
    ]
    note = "same: share of the time with the label as used, where both are scored."
    return filled_table("Labels with other settings", heads, lines, note)


def flights_json(result: FlightComparison) -> dict[str, Any]:
    """Contents of the tables, and the figures of every flight."""
    late_labels = []
    for tier, rows in result.groups.items():
        late = {str(count): _figures(one.some(rows)) for count, one in zip(POSITIONS_LATE, result.late, strict=False)}
        if result.truth is not None:
            late_labels.append({"tier": tier, "truth": value(result.truth.some(rows)), "late": late})
    flights = [
        {
            "id": flight.identity, "tier": flight.tier.name, "hours": flight.hours, "positions": len(flight.times),
            "repeated": flight.repeated, "interpolated": flight.interpolated,
            "scored": float(np.mean(labels.scored)), "turns": sum(mode != 0 for *_, mode in labels.pieces),
            "deciders": {decider: _figures(scores.some([k])) for decider, scores in result.scores.items()},
        }
        for k, (flight, labels) in enumerate(zip(result.flights, result.labels, strict=True))
    ]  # fmt: skip
    return {
        "source": str(result.task.source) if result.task.source else "package traffic", "form": result.task.form,
        "tiers": {
            tier: {name: _group_json(result, name, rows) for name in result.names}
            for tier, rows in result.groups.items()
        },
        "labels": [one._asdict() for one in result.sensitivity], "late_labels": late_labels, "flights": flights,
    }  # fmt: skip


def _figures(scores: Scores) -> dict[str, float | None]:
    return {metric.name: finite(scores.curve(metric.statistic)[0]) for metric in METRICS}


def _group_json(result: FlightComparison, decider: str, rows: list[int]) -> dict[str, Any]:
    scores, less = result.scores[decider].some(rows), less_first(result.scores, decider, rows)
    estimates = {metric.name: scores.estimate(metric.statistic) for metric in METRICS}
    found: dict[str, Any] = _figures(scores) | {
        "intervals": {name: finite([one.low, one.high]) for name, one in estimates.items()},
        "twins": _figures(result.twins[decider].some(rows)),
    }
    if less is not None:
        found["agreement_less_first"] = {"value": finite(less.value), "interval": finite([less.low, less.high])}
    return found


def flight_figures(result: FlightComparison) -> Iterator[tuple[str, Figure]]:
    """Yield the file and the picture of each flight: labels, and statements of the deciders, the last one first."""
    last = list(result.scores.values())[-1]
    for k, (flight, labels) in enumerate(zip(result.flights, result.labels, strict=True)):
        stated = {label: result.stated[name][k] for name, label in reversed(result.names.items())}
        agrees = f"{next(iter(stated))} agrees {value(last.some([k])):.1%}"
        shown = np.where(labels.scored, labels.modes, len(MODE_NAMES))
        yield f"{flight.identity.replace(':', '-')}.png", recording_figure(
            flight.positions / 1000.0, flight.times / 60.0, flight.pieces, shown, stated, MODE_NAMES,
            f"{flight.identity}, tier {flight.tier.name}: {agrees}",
        )  # fmt: skip


def glider_tables(result: GliderComparison) -> list[Table]:
    """Return the tables of each level, for the open logs and for the sealed ones, and of the simulated flights."""
    return [*(_glider_table(result, group, level) for group in result.groups for level in LEVELS), _gap_table(result)]


def _glider_table(result: GliderComparison, group: str, level: float) -> Table:
    rows, lines = result.groups[group], []
    hours = sum(float(result.labels[k].weights.sum()) for k in rows) / 3600.0
    for name, scores in result.scores[level].items():
        cells = [figure_cell(scores.some(rows), metric) for metric in GLIDER_METRICS]
        cells.append(less_cell(less_first(result.scores[level], name, rows)))
        lines.append((escape(glider_rule(name).title), *cells, f"{100.0 * value(result.simulated[level][name]):.1f}"))
    heads = ("decider", *(metric.head for metric in GLIDER_METRICS), "less\nfirst", "simul.\n%")
    title = f"{len(rows)} flights of gliders, {group}, {hours:.1f} h: at most {level:g} false an hour"
    return filled_table(title, heads, lines, GLIDER_NOTE if level == LEVELS[-1] else "")


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
                name: {one.name: finite(scores.some([k]).curve(one.statistic)[0]) for one in GLIDER_METRICS}
                for name, scores in result.scores[LEVELS[1]].items()
            },
        }
        for k, (flight, labels) in enumerate(zip(result.flights, result.labels, strict=True))
    ]  # fmt: skip
    return {"groups": groups, "flights": flights, "gap": {"percentiles": SHARES, **result.gap}, "seal": result.seal}


def _estimates(scores: Scores) -> dict[str, Any]:
    return {one.name: scores.estimate(one.statistic).as_json() for one in GLIDER_METRICS}


def glider_figure(result: GliderComparison) -> Figure:
    """The ten minutes with most changes of the flight with the median agreement of the first rule."""
    first, scores = next(iter(result.scores[LEVELS[1]].items()))
    each = [value(scores.some([k])) for k in range(len(result.flights))]
    k = int(np.argsort(each)[len(each) // 2])
    flight, labels = result.flights[k], result.labels[k]
    ends = np.searchsorted(flight.times, flight.times + SHOWN_TIME)
    changes = np.cumsum(np.diff(labels.modes, prepend=labels.modes[0]) != 0)
    first_row = int((changes[ends - 1] - changes).argmax())
    rows = slice(first_row, ends[first_row])
    shown = np.where(labels.scored, labels.modes, len(MODE_NAMES))[rows]
    minutes = (flight.times[rows] - flight.times[first_row]) / 60.0
    stated = {glider_rule(name).title: one[k][rows] for name, one in result.stated.items()}
    title = f"{flight.identity}: {glider_rule(first).title} agrees {each[k]:.1%} of the whole flight"
    kilometres = flight.positions[rows] / 1000.0
    return recording_figure(kilometres, minutes, [(0, len(minutes))], shown, stated, MODE_NAMES, title)
