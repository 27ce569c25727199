"""Deciders on recorded flights: agreement with labels from a smoother that sees the whole flight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.learned.flight_decider import shipped_flight_decider
from baselines.flights.batch import stack_flights
from baselines.flights.flight import Flight
from baselines.flights.labels import LabelRules, Labels, label_flights, smoothed_rates
from baselines.flights.metrics import FlightCounts, FlightFigures, bootstrap, count_flight, figures, unstack
from baselines.flights.samples import Samples
from baselines.flights.simulated import twins
from baselines.flights.statements import Cusum, FlightDecider, Threshold
from baselines.flights.tiers import SCORED, TIERS
from baselines.flights.turn_imm import run_turn_imm
from hybrid_env.checks import reject

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

DECIDERS: dict[str, tuple[str, Callable[[], FlightDecider]]] = {
    "imm": ("IMM threshold", Threshold),
    "imm-careful": ("IMM threshold 0.9", lambda: Threshold(threshold=0.9)),
    "cusum": ("CUSUM", Cusum),
    "agent": ("agent", shipped_flight_decider),
}
"""Name in figures and constructor of every decider; none is fitted to a recorded flight."""

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


@dataclass(frozen=True)
class FlightPlan:
    """What to compare.

    Attributes:
        source: folder or wheel of the package `traffic`; None for the installed package.
        identities: of the flights; without any those of `SCORED`.
        tiers: names of the tiers; of the default flights only these are used.
        deciders: keys of `DECIDERS`.
    """

    source: Path | None
    identities: tuple[str, ...]
    tiers: tuple[str, ...]
    deciders: tuple[str, ...]

    def check(self) -> None:
        """Raise `ArgumentError` if a name is unknown."""
        for name in self.tiers:
            if name not in TIERS:
                raise reject("tier", name, ", ".join(TIERS))
        for name in self.deciders:
            if name not in DECIDERS:
                raise reject("deciders", name, f"{', '.join(DECIDERS)} with --flights")

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
    intervals: list[tuple[float, float]]
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
        flights: the flights.
        labels: of each flight.
        stated: of each decider and flight, (n,).
        counts: of each decider and flight.
        twin_counts: the same on simulated twins.
        sensitivity: of the labels.
    """

    plan: FlightPlan
    flights: list[Flight]
    labels: list[Labels]
    stated: dict[str, list[IntArray]]
    counts: dict[str, list[FlightCounts]]
    twin_counts: dict[str, list[FlightCounts]]
    sensitivity: list[Sensitivity]

    @cached_property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the flights of each tier, and of the tiers A to C together."""
        tiers = {
            name: [k for k, flight in enumerate(self.flights) if flight.tier.name == name] for name in TIERS
        }
        good = [k for name in "ABC" for k in tiers[name]]
        together = {"A-C": good} if sum(bool(tiers[name]) for name in "ABC") > 1 else {}
        return {name: rows for name, rows in (tiers | together).items() if rows}

    def group(self, decider: str, name: str) -> Group:
        """Return the figures of a decider in a tier."""
        own, twin = (
            [counts[decider][k] for k in self.groups[name]] for counts in (self.counts, self.twin_counts)
        )
        return Group(figures(own), bootstrap(own), figures(twin))


def compare_on_flights(plan: FlightPlan, note: Callable[[str], None]) -> FlightComparison:
    """Compare deciders on flights; `note` is told what is done."""
    plan.check()
    note("reading")
    flights = plan.read()
    note("labels")
    smoothed = smoothed_rates(stack_flights(flights), LabelRules().jerk)
    labels = label_flights(flights, smoothed=smoothed)
    note("deciders")
    deciders = {name: DECIDERS[name][1]() for name in plan.deciders}
    stated, counts = _decide(deciders, flights, labels)
    note("simulated twins")
    copies, copied = twins(flights, labels, np.random.default_rng(TWIN_SEED))
    _, twin_counts = _decide(deciders, copies, copied)
    note("labels with other settings")
    sensitivity = label_sensitivity(flights, labels, smoothed, stated[plan.deciders[0]])
    return FlightComparison(plan, flights, labels, stated, counts, twin_counts, sensitivity)


def _decide(
    deciders: dict[str, FlightDecider], flights: Sequence[Flight], labels: Sequence[Labels]
) -> tuple[dict[str, list[IntArray]], dict[str, list[FlightCounts]]]:
    batch = stack_flights(flights)
    estimates = run_turn_imm(batch)
    lengths = [len(flight.times) for flight in flights]
    stated = {
        name: unstack(batch, decider.state_modes(batch, estimates), lengths)
        for name, decider in deciders.items()
    }
    return stated, {
        name: [
            count_flight(label, modes, flight.pieces)
            for flight, label, modes in zip(flights, labels, values, strict=True)
        ]
        for name, values in stated.items()
    }


def label_sensitivity(
    flights: Sequence[Flight],
    used: Sequence[Labels],
    smoothed: tuple[FloatArray, FloatArray],
    stated: Sequence[IntArray],
) -> list[Sensitivity]:
    """Return the effect of each setting of `VARIANTS`.

    Args:
        flights: the flights.
        used: their labels.
        smoothed: turn rates and speeds from which the labels follow.
        stated: statements of one decider.
    """
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
        counts = [
            count_flight(one, modes, flight.pieces)
            for flight, one, modes in zip(flights, labels, stated, strict=True)
        ]
        results.append(Sensitivity(name, same / both, scored / time, turns, figures(counts).agreement))
    return results
