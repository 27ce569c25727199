"""Deciders on recorded flights: agreement with labels from a smoother that sees the whole
flight.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from agents import load
from baselines import CusumDecider, Scores, ThresholdDecider
from hybrid_env import ArgumentError
from studies.flights.agent import FlightAgent
from studies.flights.figure import flight_figure
from studies.flights.flight import SCORED, TIERS, Flight, stack_flights
from studies.flights.labels import MODE_NAMES, Labels, Pair, label_flights
from studies.flights.samples import sample_flight
from studies.flights.scores import cell, figures, score_flights, value
from studies.flights.semi_real import WORLD, semi_real_flight, state_semi_real
from studies.flights.simulated import FlightWorld, simulate_flight, twin
from studies.flights.tracks import FlightTracks
from studies.flights.turn_beam import run_turn_beam
from studies.flights.turns import IntArray, TurnModel, run_turn_imm

COMPARED = {
    "native": ("imm", "imm:0.8", "cusum", "beam", "agent:8", "agent"),
    "semi-real": ("threshold", "beam", "beam-geometric", "shipped"),
}
"""Deciders that are compared by default in each form, the reference first."""
RULES: dict[str, tuple[str, Callable[..., Any]]] = {
    "imm": ("IMM threshold", ThresholdDecider),
    "cusum": ("CUSUM", lambda threshold=3.5: CusumDecider(threshold)),
    "beam": ("beam", ThresholdDecider),
}
"""Titles and classes of the rules of the native form."""
TWIN_SEED = 20190601


@dataclass(frozen=True, eq=False)
class FlightComparison:
    """Results."""

    form: str
    # Of the deciders by name, in figures.
    titles: dict[str, str]
    # The flights, as the deciders see them, with their labels.
    flights: list[Pair]
    # Of each decider and flight, (n,)
    stated: dict[str, list[IntArray]]
    # Of each decider.
    scores: dict[str, Scores]
    # The same on simulated twins, none in the semi-real form.
    twins: dict[str, Scores]
    # Scores of the labels themselves: `truth`, the true modes of the twins against their labels;
    # `late`, the labels stated one position late. None in the semi-real form, whose labels are
    # those of the native one.
    of_labels: dict[str, Scores]

    @property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the flights of each tier, and of the tiers A to C together."""
        names = [flight.tier.name for flight, _ in self.flights]
        groups = {
            tier: [k for k, name in enumerate(names) if name == tier]
            for tier in TIERS
            if tier in names
        }
        if all(tier in groups for tier in "ABC"):
            groups["A-C"] = [k for tier in "ABC" for k in groups[tier]]
        return groups


def find(name: str, form: str) -> tuple[str, Any]:
    """Return the title and the decider of a name with an optional threshold.

    Raises:
        ArgumentError: there is none of this name.
    """
    if form == "semi-real":
        return name, load(name, "hybrid_env:HybridTrackQuickest-v0", start=WORLD.start)
    base, *texts = name.split(":")
    try:
        numbers = list(map(float, texts))
    except ValueError:
        raise ArgumentError(f"deciders={name!r}: expected a number after the colon") from None
    if base in RULES:
        title, make = RULES[base]
    else:
        title = f"{base}, margin" if numbers else base
        make = FlightAgent.find(base, RULES)
    return " ".join([title, *(f"{number:g}" for number in numbers)]), make(*numbers)


def read_flights(
    source: Path | None,
    identities: Sequence[str],
    tiers: Sequence[str],
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


def compare_on_flights(flights: list[Flight], names: Sequence[str], form: str) -> FlightComparison:
    """Compare deciders, the first being the reference."""
    deciders = {name: find(name, form) for name in names}
    titles = {name: title for name, (title, _) in deciders.items()}
    pairs = list(zip(flights, label_flights(flights), strict=True))
    twins: dict[str, Scores] = {}
    of_labels: dict[str, Scores] = {}
    if form == "semi-real":
        generator = np.random.default_rng(20190602)
        pairs = [semi_real_flight(*pair, generator) for pair in pairs]
    else:
        generator = np.random.default_rng(TWIN_SEED)
        copies, true = zip(*(twin(*pair, generator) for pair in pairs), strict=True)
        labels = [
            of_copy.scored_in(other)
            for of_copy, (_, other) in zip(label_flights(copies), pairs, strict=True)
        ]
        on_copies = list(zip(copies, labels, strict=True))
        of_labels = {
            "truth": score_flights("truth", on_copies, [labels.modes for labels in true]),
            "late": score_flights("late", pairs, [late_modes(*pair) for pair in pairs]),
        }
        stated = state_modes(copies, deciders, form)
        twins = {name: score_flights(titles[name], on_copies, stated[name]) for name in titles}
    stated = state_modes([flight for flight, _ in pairs], deciders, form)
    scores = {name: score_flights(titles[name], pairs, stated[name]) for name in titles}
    return FlightComparison(form, titles, pairs, stated, scores, twins, of_labels)


def state_modes(
    flights: Sequence[Flight],
    deciders: dict[str, tuple[str, Any]],
    form: str,
) -> dict[str, list[IntArray]]:
    """Return the statements of each decider on each flight, (n,); 0 outside of its pieces."""
    if form == "semi-real":
        return {name: state_semi_real(decider, flights) for name, (_, decider) in deciders.items()}
    batch = stack_flights(flights)
    model = TurnModel()
    imm = run_turn_imm(batch, model)
    stated = {}
    for name, (title, decider) in deciders.items():
        beam = run_turn_beam(batch, model) if title.startswith("beam") else None
        tracks = FlightTracks(batch, imm, beam)
        is_agent = isinstance(decider, FlightAgent)
        modes = decider.statements(tracks)[..., 0] if is_agent else tracks.statements_of(decider)
        stated[name] = batch.unstack(modes)
    return stated


def late_modes(flight: Flight, labels: Labels) -> IntArray:
    """Return the labels (n,), stated one position late in each piece of the flight."""
    late = labels.modes.copy()
    for first, end in flight.pieces:
        late[first + 1 : end] = labels.modes[first : end - 1]
    return late


def as_json(result: FlightComparison) -> dict[str, Any]:
    """Return the figures of every tier as plain values."""
    tiers = {
        tier: {
            name: figures(result.scores, name, rows)
            | ({"twins": value(result.twins[name].some(rows))} if result.twins else {})
            for name in result.titles
        }
        for tier, rows in result.groups.items()
    }
    return {"form": result.form, "tiers": tiers}


def tables(result: FlightComparison, content: dict[str, Any]) -> dict[str, pd.DataFrame]:
    """Return the tables of a comparison by their titles; `content` is that of `as_json`."""
    rows = [
        {
            "tier": tier,
            "hours": f"{sum(result.flights[k][1].weights.sum() for k in group) / 3600.0:.1f}",
            "decider": result.titles[name],
            "agreement": cell(of_decider["agreement"], 3),
            "less first, points": cell(of_decider["agreement_less_first"], 1, 100.0),
            "delay, s": cell(of_decider["delay"]),
            "misses, %": cell(of_decider["misses"], 1, 100.0),
            "false/h": cell(of_decider["false_per_hour"]),
            "twins": f"{of_decider['twins']:.3f}" if result.twins else "-",
        }
        for tier, group in result.groups.items()
        for name, of_decider in content["tiers"][tier].items()
    ]
    frames = {f"Recorded flights, {result.form}": pd.DataFrame(rows)}
    if result.of_labels:
        truth, late = result.of_labels["truth"], result.of_labels["late"]
        frames["The labels themselves"] = pd.DataFrame(
            {
                "tier": tier,
                "true for twins": f"{value(truth.some(group)):.3f}",
                "stated one position late": f"{value(late.some(group)):.3f}",
                "delay, s": f"{value(late.some(group), 'delay'):.1f}",
                "false/h": f"{value(late.some(group), 'false_per_hour'):.1f}",
            }
            for tier, group in result.groups.items()
        )
    return frames


def picture(result: FlightComparison, k: int) -> Figure:
    """Draw labels of a flight, and statements of the deciders, the last one first."""
    flight, labels = result.flights[k]
    stated = {title: result.stated[name][k] for name, title in reversed(result.titles.items())}
    agrees = value([*result.scores.values()][-1].some([k]))
    return flight_figure(
        flight,
        np.where(
            labels.scored,
            labels.modes,
            len(MODE_NAMES),
        ),
        stated,
        f"{flight.identity}, tier {flight.tier.name}: {next(iter(stated))} agrees {agrees:.1%}",
    )
