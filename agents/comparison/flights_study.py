"""Deciders on recorded flights: agreement with labels from a smoother that sees the whole flight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.comparison.flights_forms import FORMS, Form
from agents.comparison.flights_late import LateLabels, late_figures
from baselines.recordings.flights.batch import stack_flights
from baselines.recordings.flights.flight import Flight
from baselines.recordings.flights.labels import (
    LabelRules,
    Labels,
    label_flights,
    scored_alike,
    smoothed_rates,
)
from baselines.recordings.flights.metrics import (
    FlightCounts,
    FlightFigures,
    bootstrap,
    count_flights,
    figures,
    paired_agreement,
)
from baselines.recordings.flights.samples import Samples
from baselines.recordings.flights.simulated import twins
from baselines.recordings.flights.tiers import SCORED, TIERS, TOGETHER
from hybrid_env.checks import reject

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

VARIANTS: dict[str, LabelRules] = {
    "as used": LabelRules(),
    "jerk 0.3 m^2/s^5": LabelRules(jerk=0.3),
    "jerk 3 m^2/s^5": LabelRules(jerk=3.0),
    "peak 0.5 deg/s": LabelRules(peak=0.5),
    "peak 1 deg/s": LabelRules(peak=1.0),
    "bound 0.25 deg/s": LabelRules(bound=0.25),
    "bound 0.5 deg/s": LabelRules(bound=0.5),
    "change 10 deg": LabelRules(change=10.0),
    "change 20 deg": LabelRules(change=20.0),
}
"""Settings of the labels whose effect is shown."""

TWIN_SEED = 20190601
NOISE_SEED, TWIN_NOISE_SEED = 20190602, 20190603


@dataclass(frozen=True)
class FlightPlan:
    """What to compare.

    Attributes:
        source: folder or wheel of the package `traffic`; None for the installed package.
        identities: of the flights; without any those of `SCORED`.
        tiers: names of the tiers; of the default flights only these are used.
        form: key of `FORMS`.
        deciders: of that form; without any its default ones.
    """

    source: Path | None
    identities: tuple[str, ...]
    tiers: tuple[str, ...]
    form: str
    deciders: tuple[str, ...]

    @property
    def seen(self) -> Form:
        """How deciders see the flights."""
        return FORMS[self.form]

    @cached_property
    def labels(self) -> dict[str, str]:
        """Names of the deciders in figures."""
        return {name: self.seen.label(name) for name in self.deciders or self.seen.deciders}

    def check(self) -> None:
        """Raise `ArgumentError` if a name is unknown."""
        for name in self.tiers:
            if name not in TIERS:
                raise reject("tier", name, ", ".join(TIERS))
        if self.form not in FORMS:
            raise reject("form", self.form, ", ".join(FORMS))
        if len(self.labels) < len(self.deciders):
            raise reject("deciders", self.deciders, "different names")

    def read(self) -> list[Flight]:
        """Return the flights of the tiers.

        Raises:
            ArgumentError: there are no samples, or there is no such flight.
        """
        samples = Samples(self.source)
        wanted = self.identities or tuple(one for tier in self.tiers for one in SCORED[tier])
        by_file = sorted(dict.fromkeys(wanted))  # the flights of a file one after the other
        found = {identity: samples.flight(identity) for identity in by_file}
        flights = [found[identity] for identity in dict.fromkeys(wanted)]
        flights = [flight for flight in flights if flight.tier.name in self.tiers]
        if not flights:
            raise reject("tier", self.tiers, "tiers of the flights")
        return flights


class Group(NamedTuple):
    """Figures of one decider on some flights.

    Attributes:
        figures: see `FlightFigures`.
        intervals: 95 % interval of each, from flights drawn with replacement.
        twin: figures on simulated twins.
    """

    figures: FlightFigures
    intervals: dict[str, tuple[float, float]]
    twin: FlightFigures


class Sensitivity(NamedTuple):
    """Effect of one setting of the labels.

    Attributes:
        name: the setting.
        same: share of the time, scored with both settings, with the label as used.
        scored: share of the time that is scored.
        turns: number of turns.
        agreement: of the first decider, in the tiers that are compared.
    """

    name: str
    same: float
    scored: float
    turns: int
    agreement: float


@dataclass(frozen=True, eq=False)
class FlightComparison:
    """Results.

    Attributes:
        plan: settings.
        flights: the flights, as the deciders see them.
        labels: of each flight.
        stated: of each decider and flight, (n,).
        counts: of each decider and flight.
        twin_counts: the same on simulated twins.
        sensitivity: of the labels; none in the semi-real form, whose labels are those of the native one.
        late_labels: figures of the labels, stated late, in each tier; none in the semi-real form.
    """

    plan: FlightPlan
    flights: list[Flight]
    labels: list[Labels]
    stated: dict[str, list[IntArray]]
    counts: dict[str, list[FlightCounts]]
    twin_counts: dict[str, list[FlightCounts]]
    sensitivity: list[Sensitivity]
    late_labels: list[LateLabels]

    @cached_property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the flights of each tier, and of the tiers A to C together."""
        return group_flights(self.flights)

    @cached_property
    def counted(self) -> list[int]:
        """Indices of the flights in the totals: all but those of the stress tier, if there are others."""
        return without_stress(self.flights)

    def group(self, decider: str, name: str) -> Group:
        """Return the figures of a decider in a tier."""
        own, twin = (
            [counts[decider][k] for k in self.groups[name]] for counts in (self.counts, self.twin_counts)
        )
        return Group(figures(own), bootstrap(own), figures(twin))

    def difference(self, decider: str, name: str) -> tuple[float, tuple[float, float]]:
        """Return the agreement in a tier less that of the first decider, and its 95 % interval."""
        first = next(iter(self.counts))
        own, other = ([self.counts[one][k] for k in self.groups[name]] for one in (decider, first))
        return paired_agreement(own, other)


def group_flights(flights: Sequence[Flight]) -> dict[str, list[int]]:
    """Return the indices of the flights of each tier, and of those of the tiers A to C together."""
    tiers = {name: [k for k, flight in enumerate(flights) if flight.tier.name == name] for name in TIERS}
    found = [name for name in TOGETHER if tiers[name]]
    title = "A-C" if len(found) == len(TOGETHER) else "+".join(found)
    together = {title: [k for name in found for k in tiers[name]]} if len(found) > 1 else {}
    return {name: rows for name, rows in (tiers | together).items() if rows}


def without_stress(flights: Sequence[Flight]) -> list[int]:
    """Return the indices of the flights that are not of the stress tier; of all if there are no others."""
    return [k for k, flight in enumerate(flights) if flight.tier.name != "stress"] or list(
        range(len(flights))
    )


def compare_on_flights(plan: FlightPlan, note: Callable[[str], None]) -> FlightComparison:
    """Compare deciders on flights; `note` is told what is done: `steps` texts."""
    plan.check()
    note("reading")
    flights = plan.read()
    note("labels")
    labels = label_flights(flights)
    copies, truth = twins(flights, labels, np.random.default_rng(TWIN_SEED))
    copied = [scored_alike(*pair) for pair in zip(label_flights(copies), labels, strict=True)]
    seen = plan.seen.convert(flights, labels, NOISE_SEED)
    stated, counts = _decide(plan, *seen, note)
    _, twin_counts = _decide(plan, *plan.seen.convert(copies, copied, TWIN_NOISE_SEED), note, "twins, ")
    sensitivity, late = [], []
    if plan.form == "native":
        note("labels with other settings")
        rows, reference = without_stress(flights), stated[next(iter(plan.labels))]
        sensitivity = label_sensitivity(
            [flights[k] for k in rows], [labels[k] for k in rows], [reference[k] for k in rows]
        )
        late = late_figures(group_flights(flights), flights, labels, copied, truth)
    return FlightComparison(plan, *seen, stated, counts, twin_counts, sensitivity, late)


def steps(plan: FlightPlan) -> int:
    """Return how often `compare_on_flights` says what is done."""
    return 2 + 2 * len(plan.labels) + (plan.form == "native")


def _decide(
    plan: FlightPlan,
    flights: Sequence[Flight],
    labels: Sequence[Labels],
    note: Callable[[str], None],
    text: str = "",
) -> tuple[dict[str, list[IntArray]], dict[str, list[FlightCounts]]]:
    run = plan.seen.run(flights)
    stated = {}
    for name, label in plan.labels.items():
        note(f"{text}{label}")
        stated[name] = run(name)
    return stated, {name: count_flights(flights, labels, values) for name, values in stated.items()}


def label_sensitivity(
    flights: Sequence[Flight], used: Sequence[Labels], stated: Sequence[IntArray]
) -> list[Sensitivity]:
    """Return the effect of each setting of `VARIANTS`.

    Args:
        flights: the flights.
        used: their labels.
        stated: statements of one decider.
    """
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
        counts = count_flights(flights, labels, stated)
        results.append(Sensitivity(name, same / both, scored / time, turns, figures(counts).agreement))
    return results
