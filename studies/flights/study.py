"""Deciders on recorded flights: agreement with labels from a smoother that sees the whole
flight.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from baselines import Scores
from hybrid_env import ArgumentError
from studies.flights.agent import FlightAgent
from studies.flights.figure import flight_figure
from studies.flights.flight import SCORED, TIERS, Flight, stack_flights
from studies.flights.hindsight import HINDSIGHT
from studies.flights.labels import Labels, Pair, label_flights
from studies.flights.rules import RULES
from studies.flights.samples import sample_flight
from studies.flights.scores import estimates_beside_first, score_flights, table, value
from studies.flights.simulated import FlightWorld, simulate_flight, twin
from studies.flights.turns import IntArray, TurnModel, run_turn_imm

DECIDERS = RULES | {"hindsight": HINDSIGHT}
"""All rules by name."""
COMPARED = ("imm", "imm:0.8", "cusum", "beam", "hindsight", "agent:8", "agent")
"""Deciders that are compared by default, the reference first."""
TWIN_SEED = 20190601
LABELS = "labels, late"
"""The labels as a decider: one position late on flights, and the true modes on twins."""


@dataclass(frozen=True, eq=False)
class FlightComparison:
    """Results; statements and scores are those of each decider, by its name."""

    # The flights with their labels.
    flights: list[Pair]
    # On each flight, (n, 1)
    stated: dict[str, list[IntArray]]
    scores: dict[str, Scores]
    # Scores on simulated twins.
    twins: dict[str, Scores]


def find(name: str) -> Any:
    """Return the rule of a decider and its setting.

    Raises:
        ArgumentError: there is none of this name.
    """
    base, colon, number = name.partition(":")
    rule = DECIDERS[base] if base in DECIDERS else FlightAgent.rule(base, DECIDERS)
    try:
        return rule, [(float(number),) * len(rule.grid[0])] if colon else rule.grid[:1]
    except ValueError:
        raise ArgumentError(f"deciders={name!r}: expected a number after the colon") from None


def read_flights(
    source: Path | None, identities: Sequence[str], tiers: Sequence[str]
) -> list[Flight]:
    """Return the flights of identities, or those of the tiers; see `sample_flight` for the
    source.
    """
    names = identities or [name for tier in tiers for name in SCORED[tier].split()]
    # Those of a file one after the other.
    flights = {name: sample_flight(source, name) for name in sorted(set(names))}
    return [flights[name] for name in dict.fromkeys(names)]


def quick_flights(duration: float = 600.0) -> list[Flight]:
    """Return short simulated flights [s] in the place of recorded ones."""
    generator = np.random.default_rng(TWIN_SEED)
    return [
        simulate_flight(TIERS[name], duration, generator, FlightWorld(), f"simulated:{name}:0")[0]
        for name in "ABC"
    ]


def compare_on_flights(flights: list[Flight], names: Sequence[str]) -> FlightComparison:
    """Compare deciders, the first being the reference."""
    deciders = {name: find(name) for name in names}
    pairs = list(zip(flights, label_flights(flights), strict=True))
    generator = np.random.default_rng(TWIN_SEED)
    copies, true = zip(*(twin(*pair, generator) for pair in pairs), strict=True)
    labels = [
        replace(ours, weights=ours.weights * theirs.scored, scored=ours.scored & theirs.scored)
        for ours, (_, theirs) in zip(label_flights(copies), pairs, strict=True)
    ]
    modes = state_modes(copies, deciders) | {LABELS: [each.modes[:, None] for each in true]}
    on_copies = list(zip(copies, labels, strict=True))
    twins = {name: score_flights(on_copies, modes[name]) for name in modes}
    stated = state_modes(flights, deciders)
    stated[LABELS] = [late_modes(*pair) for pair in pairs]
    scores = {name: score_flights(pairs, stated[name]) for name in stated}
    return FlightComparison(pairs, stated, scores, twins)


def state_modes(flights: Sequence[Flight], deciders: dict[str, Any]) -> dict[str, list[IntArray]]:
    """Return the statements of each decider on each flight, (n, 1); 0 outside of its pieces."""
    batch = stack_flights(flights)
    imm = run_turn_imm(batch, TurnModel())
    return {
        name: batch.unstack(rule.statements(batch, imm, settings, rule.models[0]))
        for name, (rule, settings) in deciders.items()
    }


def late_modes(flight: Flight, labels: Labels) -> IntArray:
    """Return the labels (n, 1), stated one position late in each piece of the flight."""
    late = labels.modes.copy()
    for rows in flight.pieces:
        late[rows][1:] = labels.modes[rows][:-1]
    return late[:, None]


def report(result: FlightComparison) -> tuple[str, dict[str, Any]]:
    """Return the tables of a comparison, and the statistics of every tier."""
    names = [flight.tier.name for flight, _ in result.flights]
    groups = {tier: [k for k, name in enumerate(names) if name == tier] for tier in TIERS}
    if all(groups[tier] for tier in "ABC"):
        groups["A-C"] = [k for tier in "ABC" for k in groups[tier]]
    tiers = {}
    texts = []
    for tier, rows in groups.items():
        if rows:
            tiers[tier] = {
                name: estimates_beside_first(result.scores, name, rows) for name in result.scores
            }
            for name, scores in result.twins.items():
                tiers[tier][name]["twins"] = value(scores.some(rows))
            hours = sum(result.flights[k][1].weights.sum() for k in rows) / 3600.0
            title = f"Recorded flights, tier {tier}, {hours:.1f} h"
            texts.append(table(title, tiers[tier]))
    return "\n".join(texts), {"tiers": tiers}


def picture(result: FlightComparison, k: int) -> Figure:
    """Draw labels of a flight, and statements of the deciders, the last one first."""
    flight, labels = result.flights[k]
    stated = {
        name: modes[k][:, 0] for name, modes in reversed(result.stated.items()) if name != LABELS
    }
    name = next(iter(stated))
    agrees = value(result.scores[name].some([k]))
    title = f"{flight.identity}, tier {flight.tier.name}: {name} agrees {agrees:.1%}"
    return flight_figure(flight, labels.shown, stated, title)
