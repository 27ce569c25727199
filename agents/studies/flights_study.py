"""Deciders on recorded flights: agreement with labels from a smoother that sees the whole
flight.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import filled_table
from agents.evaluation.flights import (
    METRICS,
    NATIVE,
    SECOND_LINES,
    FlightTask,
    figure_cell,
    less_cell,
    less_first,
    value,
)
from agents.figures.tracks import recording_figure
from agents.interface.output_files import finite
from baselines.recordings.flights.flight import TIERS, TOGETHER, Flight, stack_flights
from baselines.recordings.flights.labels import (
    MODE_NAMES,
    LabelRules,
    Labels,
    label_flights,
    scored_alike,
    smoothed_rates,
)
from baselines.recordings.flights.metrics import score_flights
from baselines.recordings.flights.simulated import twins
from baselines.scoring.scores import Scores
from hybrid_env.checks import IntArray

CHANGED = (
    ("jerk", (0.3, 3.0), "m^2/s^5"),
    ("peak", (0.5, 1.0), "deg/s"),
    ("bound", (0.25, 0.5), "deg/s"),
    ("change", (10.0, 20.0), "deg"),
)
VARIANTS = {"as used": LabelRules()} | {
    f"{name} {value:g} {unit}": LabelRules(**{name: value})
    for name, values, unit in CHANGED
    for value in values
}
"""Settings of the labels whose effect is shown."""

POSITIONS_LATE = (1, 2)
TWIN_SEED = 20190601
NOISE_SEED, TWIN_NOISE_SEED = 20190602, 20190603
# Shown in brackets after all false changes.
TURNS = "false_turns_per_hour"


@dataclass(frozen=True, eq=False)
class FlightComparison:
    """Results."""

    # Settings.
    task: FlightTask
    # Of the deciders, and in figures.
    names: dict[str, str]
    # The flights, as the deciders see them.
    flights: list[Flight]
    # Of each flight.
    labels: list[Labels]
    # Of each decider and flight, (n,)
    stated: dict[str, list[IntArray]]
    # Of each decider.
    scores: dict[str, Scores]
    # The same on simulated twins.
    twins: dict[str, Scores]
    # The semi-real form has none of these, since its labels are those of the native one
    # Scores of the true modes of the twins against their labels.
    truth: Scores | None = None
    # Of the labels, stated a number of positions late.
    late: Mapping[int, Scores] = field(default_factory=dict)
    # Effect of settings of the labels, see `label_sensitivity`.
    sensitivity: Sequence[dict[str, Any]] = ()

    @cached_property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the flights of each tier, and of the tiers A to C together."""
        tiers = {
            name: [k for k, flight in enumerate(self.flights) if flight.tier.name == name]
            for name in TIERS
        }
        found = [name for name in TOGETHER if tiers[name]]
        title = "A-C" if len(found) == len(TOGETHER) else "+".join(found)
        together = {title: [k for name in found for k in tiers[name]]} if len(found) > 1 else {}
        return {name: rows for name, rows in (tiers | together).items() if rows}


def without_stress(flights: Sequence[Flight]) -> list[int]:
    """Return the indices of the flights that are not of the stress tier; of all if there are no
    others.
    """
    rows = list(range(len(flights)))
    return [k for k in rows if flights[k].tier.name != "stress"] or rows


def compare_on_flights(
    task: FlightTask,
    names: dict[str, str],
    note: Callable[[str], None],
) -> FlightComparison:
    """Compare deciders, named as in figures, on flights; `note` is called with what is done,
    `steps` times.
    """
    note("reading")
    flights = task.read()
    note("labels")
    labels = label_flights(flights)
    copies, truth = twins(flights, labels, np.random.default_rng(TWIN_SEED))
    copied = [scored_alike(*pair) for pair in zip(label_flights(copies), labels, strict=True)]
    seen = task.convert(flights, labels, NOISE_SEED)
    stated, scores = _decide(task, names, *seen, note)
    _, of_twins = _decide(
        task,
        names,
        *task.convert(copies, copied, TWIN_NOISE_SEED),
        note,
        "twins, ",
    )
    result = FlightComparison(task, names, *seen, stated, scores, of_twins)
    if task.form != NATIVE:
        return result
    note("labels with other settings")
    rows = without_stress(flights)
    reference = next(iter(stated.values()))
    sensitivity = label_sensitivity(
        *([values[k] for k in rows] for values in (flights, labels, reference))  # type: ignore[arg-type]
    )
    of_truth = score_flights("truth", flights, copied, [one.modes for one in truth])
    late = {}
    for count in POSITIONS_LATE:
        modes = [late_modes(*pair, count) for pair in zip(flights, labels, strict=True)]
        late[count] = score_flights(f"{count} late", flights, labels, modes)
    return replace(result, truth=of_truth, late=late, sensitivity=sensitivity)


def steps(task: FlightTask, deciders: int) -> int:
    """Return the number of calls of `note` by `compare_on_flights`."""
    return 2 + 2 * deciders + (task.form == NATIVE)


def _decide(
    task: FlightTask,
    names: dict[str, str],
    flights: Sequence[Flight],
    labels: Sequence[Labels],
    note: Callable[[str], None],
    text: str = "",
) -> tuple[dict[str, list[IntArray]], dict[str, Scores]]:
    state = task.statements(flights)
    stated = {}
    for name, label in names.items():
        note(f"{text}{label}")
        stated[name] = state(name)
    return stated, {
        name: score_flights(names[name], flights, labels, one) for name, one in stated.items()
    }


def late_modes(flight: Flight, labels: Labels, count: int) -> IntArray:
    """Return the labels (n,), stated `count` positions late in each piece of the flight."""
    rows = np.arange(len(flight.times))
    for first, end in flight.pieces:
        rows[first:end] = np.maximum(rows[first:end] - count, first)
    return labels.modes[rows]


def label_sensitivity(
    flights: Sequence[Flight],
    used: Sequence[Labels],
    stated: Sequence[IntArray],
) -> list[dict[str, Any]]:
    """Return the effect of each setting of `VARIANTS` on the labels of flights, as rows of a table.

    same: share of the time, scored with both settings, with the label as used. scored: share of the
    time that is scored. turns: their number. agreement: of the statements of one decider.
    """
    smoothed = smoothed_rates(stack_flights(flights), LabelRules().jerk)
    rows = []
    for name, rules in VARIANTS.items():
        labels = label_flights(
            flights,
            rules,
            smoothed if rules.jerk == LabelRules().jerk else None,
        )
        time = scored = both = same = 0.0
        for one, other in zip(used, labels, strict=True):
            widths = np.gradient(one.times)
            common = widths * (one.scored & other.scored)
            time += float(widths.sum())
            scored += float(widths[other.scored].sum())
            both += float(common.sum())
            same += float(common[one.modes == other.modes].sum())
        turns = sum(sum(mode != 0 for *_, mode in one.pieces) for one in labels)
        agreement = value(score_flights(name, flights, labels, stated))
        rows.append(
            {
                "name": name,
                "same": same / both,
                "scored": scored / time,
                "turns": turns,
                "agreement": agreement,
            }
        )
    return rows


def tables(result: FlightComparison) -> list[Table]:
    """Return the tables of a comparison."""
    tables = [_figures_table(result)]
    first, *others = result.names.items()
    if others:
        lines: list[Sequence[str]] = [
            (tier, *(less_cell(less_first(result.scores, name, rows)) for name, _ in others))
            for tier, rows in result.groups.items()
        ]
        title = f"Agreement less that of {first[1]}, percentage points"
        tables.append(
            filled_table(
                title,
                ("tier", *(escape(label) for _, label in others)),
                lines,
                SECOND_LINES,
            )
        )
    if result.truth is not None:
        heads = ["tier", "truth"]
        for count in result.late:
            heads += [f"{count} late:\nagreement", "delay\ns", "false\nper hour"]
        lines = []
        for tier, rows in result.groups.items():
            cells = [tier, f"{value(result.truth.some(rows)):.3f}"]
            for some in (late.some(rows) for late in result.late.values()):
                cells += [
                    f"{value(some):.3f}",
                    *(f"{value(some, name):.1f}" for name in ("delay", "false_per_hour")),
                ]
            lines.append(cells)
        late_note = (
            "Late: figures of a decider that states the labels this number of positions late.\n"
            "Truth: share of the time in which labels of twins are the true modes."
        )
        tables.append(filled_table("The labels themselves, stated late", heads, lines, late_note))
        heads = ["setting", "same", "scored", "turns", f"agreement of\n{escape(first[1])}"]
        lines = [
            (name, f"{same:.3f}", f"{scored:.3f}", f"{turns}", f"{agreement:.3f}")
            for name, same, scored, turns, agreement in (one.values() for one in result.sensitivity)
        ]
        same_note = "same: share of the time with the label as used, where both are scored."
        tables.append(filled_table("Labels with other settings", heads, lines, same_note))
    return tables


def _figures_table(result: FlightComparison) -> Table:
    """Figures of each decider in each tier, with 95 % intervals over flights."""
    first = next(iter(result.scores.values()))
    counted = without_stress(result.flights)
    hours = sum(first.of("scored", 0)[counted]) / 3600.0
    form = "" if result.task.form == NATIVE else f", {result.task.form}"
    shown = [metric for metric in METRICS if metric.name != TURNS]
    lines: list[tuple[str, ...]] = []
    for tier, rows in result.groups.items():
        for number, (decider, label) in enumerate(result.names.items()):
            scores = result.scores[decider].some(rows)
            cells = [
                figure_cell(scores, one, TURNS * (one.name == "false_per_hour")) for one in shown
            ]
            head = f"{tier}\n({len(rows)})" if number == 0 else ""
            lines.append(
                (head, escape(label), *cells, f"{value(result.twins[decider].some(rows)):.3f}")
            )
        lines.append(())
    return filled_table(
        f"{len(counted)} recorded flights{form}, {hours:.1f} scored hours",
        ("tier", "decider", *(metric.head for metric in shown), "twins"),
        lines,
        f"{SECOND_LINES}\n"
        "Twins: agreement on simulated flights with the same steps, speeds and turns.\n"
        "Delay: from a change of the label to the first right statement.\n"
        "False: a change to a mode that is not the label until the next change;\n"
        "in brackets those of them to a turn while the label is straight motion.",
        2,
    )


def files(result: FlightComparison) -> dict[str, Any]:
    """Return flights.json, with the figures of every flight, and a picture of each flight, by
    file name.
    """
    flights = [
        {
            "id": flight.identity,
            "tier": flight.tier.name,
            "hours": flight.hours,
            "positions": len(flight.times),
            "repeated": flight.repeated,
            "interpolated": flight.interpolated,
            "scored": float(np.mean(labels.scored)),
            "turns": sum(mode != 0 for *_, mode in labels.pieces),
            "deciders": {
                decider: _figures(scores.some([k])) for decider, scores in result.scores.items()
            },
        }
        for k, (flight, labels) in enumerate(zip(result.flights, result.labels, strict=True))
    ]
    late = [
        {
            "tier": tier,
            "truth": value(result.truth.some(rows)),
            "late": {str(count): _figures(one.some(rows)) for count, one in result.late.items()},
        }
        for tier, rows in result.groups.items()
        if result.truth is not None
    ]
    content = {
        "source": str(result.task.source) if result.task.source else "package traffic",
        "form": result.task.form,
        "tiers": {
            tier: {name: _group_json(result, name, rows) for name in result.names}
            for tier, rows in result.groups.items()
        },
        "labels": result.sensitivity,
        "late_labels": late,
        "flights": flights,
    }
    pictures = {
        f"{one.identity.replace(':', '-')}.png": _picture(result, k)
        for k, one in enumerate(result.flights)
    }
    return {"flights.json": content} | pictures


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
        found["agreement_less_first"] = {
            "value": finite(less.value),
            "interval": finite([less.low, less.high]),
        }
    return found


def _picture(result: FlightComparison, k: int) -> Figure:
    """Draw labels of a flight, and statements of the deciders, the last one first."""
    flight, labels = result.flights[k], result.labels[k]
    stated = {label: result.stated[name][k] for name, label in reversed(result.names.items())}
    agrees = value([*result.scores.values()][-1].some([k]))
    return recording_figure(
        flight.positions / 1000.0,
        flight.times / 60.0,
        flight.pieces,
        np.where(labels.scored, labels.modes, len(MODE_NAMES)),
        stated,
        MODE_NAMES,
        f"{flight.identity}, tier {flight.tier.name}: {next(iter(stated))} agrees {agrees:.1%}",
    )
