"""Deciders on recorded flights: agreement with labels from a smoother that sees the whole flight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from agents.evaluation.flights import NATIVE, FlightTask
from baselines.recordings.flights.flight import TIERS, TOGETHER, Flight, stack_flights
from baselines.recordings.flights.labels import LabelRules, Labels, label_flights, scored_alike, smoothed_rates
from baselines.recordings.flights.metrics import STATISTICS, score_flights
from baselines.recordings.flights.simulated import twins
from baselines.scoring.scores import Scores
from hybrid_env.checks import IntArray

CHANGED = (
    ("jerk", (0.3, 3.0), "m^2/s^5"), ("peak", (0.5, 1.0), "deg/s"), ("bound", (0.25, 0.5), "deg/s"),
    ("change", (10.0, 20.0), "deg"),
)  # fmt: skip
VARIANTS = {"as used": LabelRules()} | {
    f"{name} {value:g} {unit}": LabelRules(**{name: value}) for name, values, unit in CHANGED for value in values
}
"""Settings of the labels whose effect is shown."""

POSITIONS_LATE = (1, 2)
TWIN_SEED = 20190601
NOISE_SEED, TWIN_NOISE_SEED = 20190602, 20190603


class Sensitivity(NamedTuple):
    """Effect of one setting of the labels."""

    name: str  # the setting
    same: float  # share of the time, scored with both settings, with the label as used
    scored: float  # share of the time that is scored
    turns: int  # number of turns
    agreement: float  # of the first decider, in the tiers that are compared


@dataclass(frozen=True, eq=False)
class FlightComparison:
    """Results."""

    task: FlightTask  # settings
    names: dict[str, str]  # of the deciders, and in figures
    flights: list[Flight]  # the flights, as the deciders see them
    labels: list[Labels]  # of each flight
    stated: dict[str, list[IntArray]]  # of each decider and flight, (n,)
    scores: dict[str, Scores]  # of each decider
    twins: dict[str, Scores]  # the same on simulated twins
    # the semi-real form has none of these, since its labels are those of the native one
    truth: Scores | None = None  # scores of the true modes of the twins against their labels
    late: Sequence[Scores] = ()  # of the labels, stated as many positions late as `POSITIONS_LATE` says
    sensitivity: Sequence[Sensitivity] = ()  # of the labels

    @cached_property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the flights of each tier, and of the tiers A to C together."""
        tiers = {name: [k for k, flight in enumerate(self.flights) if flight.tier.name == name] for name in TIERS}
        found = [name for name in TOGETHER if tiers[name]]
        title = "A-C" if len(found) == len(TOGETHER) else "+".join(found)
        together = {title: [k for name in found for k in tiers[name]]} if len(found) > 1 else {}
        return {name: rows for name, rows in (tiers | together).items() if rows}


def without_stress(flights: Sequence[Flight]) -> list[int]:
    """Return the indices of the flights that are not of the stress tier; of all if there are no others."""
    rows = list(range(len(flights)))
    return [k for k in rows if flights[k].tier.name != "stress"] or rows


def compare_on_flights(task: FlightTask, names: dict[str, str], note: Callable[[str], None]) -> FlightComparison:
    """Compare deciders, named as in figures, on flights; `note` is called with what is done, `steps` times."""
    note("reading")
    flights = task.read()
    note("labels")
    labels = label_flights(flights)
    copies, truth = twins(flights, labels, np.random.default_rng(TWIN_SEED))
    copied = [scored_alike(*pair) for pair in zip(label_flights(copies), labels, strict=True)]
    seen = task.convert(flights, labels, NOISE_SEED)
    stated, scores = _decide(task, names, *seen, note)
    _, of_twins = _decide(task, names, *task.convert(copies, copied, TWIN_NOISE_SEED), note, "twins, ")
    result = FlightComparison(task, names, *seen, stated, scores, of_twins)
    if task.form != NATIVE:
        return result
    note("labels with other settings")
    rows, reference = without_stress(flights), next(iter(stated.values()))
    sensitivity = _label_sensitivity(
        *([values[k] for k in rows] for values in (flights, labels, reference))  # type: ignore[arg-type]
    )
    of_truth = score_flights("truth", flights, copied, [one.modes for one in truth])
    late = []
    for count in POSITIONS_LATE:
        modes = [late_modes(*pair, count) for pair in zip(flights, labels, strict=True)]
        late.append(score_flights(f"{count} late", flights, labels, modes))
    return replace(result, truth=of_truth, late=late, sensitivity=sensitivity)


def steps(task: FlightTask, deciders: int) -> int:
    """Return the number of calls of `note` by `compare_on_flights`."""
    return 2 + 2 * deciders + (task.form == NATIVE)


def _decide(
    task: FlightTask, names: dict[str, str], flights: Sequence[Flight], labels: Sequence[Labels],
    note: Callable[[str], None], text: str = "",
) -> tuple[dict[str, list[IntArray]], dict[str, Scores]]:  # fmt: skip
    state, stated = task.statements(flights), {}
    for name, label in names.items():
        note(f"{text}{label}")
        stated[name] = state(name)
    return stated, {name: score_flights(names[name], flights, labels, one) for name, one in stated.items()}


def late_modes(flight: Flight, labels: Labels, count: int) -> IntArray:
    """Return the labels (n,), stated `count` positions late in each piece of the flight."""
    rows = np.arange(len(flight.times))
    for first, end in flight.pieces:
        rows[first:end] = np.maximum(rows[first:end] - count, first)
    return labels.modes[rows]


def _label_sensitivity(
    flights: Sequence[Flight], used: Sequence[Labels], stated: Sequence[IntArray]
) -> list[Sensitivity]:
    """Return the effect of each setting of `VARIANTS` on the labels of flights and one decider."""
    smoothed = smoothed_rates(stack_flights(flights), LabelRules().jerk)
    results = []
    for name, rules in VARIANTS.items():
        labels = label_flights(flights, rules, smoothed if rules.jerk == LabelRules().jerk else None)
        time = scored = both = same = 0.0
        for one, other in zip(used, labels, strict=True):
            widths = np.gradient(one.times)
            time += float(widths.sum())
            scored += float(widths[other.scored].sum())
            common = widths * (one.scored & other.scored)
            both += float(common.sum())
            same += float(common[one.modes == other.modes].sum())
        turns = sum(sum(mode != 0 for *_, mode in one.pieces) for one in labels)
        agreement = float(score_flights(name, flights, labels, stated).curve(STATISTICS["agreement"])[0])
        results.append(Sensitivity(name, same / both, scored / time, turns, agreement))
    return results
