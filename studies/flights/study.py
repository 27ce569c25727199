"""Deciders on recorded flights: agreement with labels from a smoother that sees the whole
flight.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from agents import load
from baselines import CusumDecider, Estimate, Scores, ThresholdDecider
from hybrid_env import ArgumentError
from studies.flights.agent import FlightAgent
from studies.flights.figure import flight_figure
from studies.flights.flight import SCORED, TIERS, TOGETHER, Flight, stack_flights
from studies.flights.labels import (
    MODE_NAMES,
    Labels,
    label_flights,
    scored_alike,
)
from studies.flights.metrics import STATISTICS, score_flights
from studies.flights.samples import Samples
from studies.flights.semi_real import WORLD, semi_real_flights, state_semi_real
from studies.flights.simulated import simulate_flights, twins
from studies.flights.tracks import FlightTracks
from studies.flights.turn_beam import run_turn_beam
from studies.flights.turns import IntArray, run_turn_imm

NATIVE, SEMI_REAL = "native", "semi-real"
AGENT = "agent"
COMPARED = {
    NATIVE: ("imm", "imm:0.8", "cusum", "beam", "agent:8", AGENT),
    SEMI_REAL: ("threshold", "beam", "beam-geometric", "shipped"),
}
"""Deciders that are compared by default, the reference first."""
RULES: dict[str, tuple[str, Callable[..., Any]]] = {
    "imm": ("IMM threshold", ThresholdDecider),
    "cusum": ("CUSUM", lambda threshold=3.5: CusumDecider(threshold)),
    "beam": ("beam", ThresholdDecider),
}
"""Titles and classes of the rules of the native form."""
SHIPPED = Path(__file__).with_name("shipped")
ENVIRONMENT = "hybrid_env:HybridTrackQuickest-v0"

TWIN_SEED = 20190601
NOISE_SEED, TWIN_NOISE_SEED = 20190602, 20190603
# Of the quick form [s].
QUICK_DURATION = 600.0


@dataclass(frozen=True, eq=False)
class FlightComparison:
    """Results."""

    form: str
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
    # The semi-real form has none of these, since its labels are those of the native one.
    # Scores of the true modes of the twins against their labels.
    truth: Scores | None = None
    # Of the labels, stated one position late.
    late: Scores | None = None

    @functools.cached_property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the flights of each tier, and of the tiers A to C together."""
        tiers = {
            name: [k for k, flight in enumerate(self.flights) if flight.tier.name == name]
            for name in TIERS
        }
        present = [name for name in TOGETHER if tiers[name]]
        title = "A-C" if len(present) == len(TOGETHER) else "+".join(present)
        together = {title: [k for name in present for k in tiers[name]]} if len(present) > 1 else {}
        return {name: rows for name, rows in (tiers | together).items() if rows}


def split_threshold(name: str) -> tuple[str, float | None]:
    """Return the name of a decider, and the number after its colon."""
    base, _, text = name.rpartition(":")
    try:
        return (base, float(text)) if base else (name, None)
    except ValueError:
        return name, None


def find(name: str, form: str) -> tuple[str, Any]:
    """Return the title and the decider of a name with an optional threshold.

    Raises:
        ArgumentError: there is none of this name.
    """
    if form == SEMI_REAL:
        return name, load(name, ENVIRONMENT, start=WORLD.start)
    base, threshold = split_threshold(name)
    number = () if threshold is None else (threshold,)
    if base in RULES:
        title, make = RULES[base]
    else:
        title = base if threshold is None else f"{base}, margin"
        folder = SHIPPED if base == AGENT else Path(base)
        if not folder.is_dir():
            expected = ", ".join((*RULES, AGENT))
            raise ArgumentError(
                f"deciders={name!r}: expected {expected}, or the folder of an agent"
            )
        make = FlightAgent.read(folder)
    return title if threshold is None else f"{title} {threshold:g}", make(*number)


def read_flights(
    source: Path | None,
    identities: Sequence[str],
    tiers: Sequence[str],
) -> list[Flight]:
    """Return the flights of identities, or those of the tiers; see `Samples` for the source."""
    samples = Samples(source)
    wanted = identities or [identity for tier in tiers for identity in SCORED[tier]]
    # Those of a file one after the other.
    read = {identity: samples.flight(identity) for identity in sorted(set(wanted))}
    flights = [read[identity] for identity in dict.fromkeys(wanted)]
    flights = [flight for flight in flights if flight.tier.name in tiers]
    if not flights:
        raise ArgumentError(f"tier={tuple(tiers)}: expected tiers of the flights")
    return flights


def quick_flights() -> list[Flight]:
    """Return short simulated flights in the place of recorded ones."""
    generator = np.random.default_rng(TWIN_SEED)
    return [
        replace(flight, identity=f"simulated:{name}:0")
        for name in TOGETHER
        for flight in simulate_flights(TIERS[name], 1, QUICK_DURATION, generator)[0]
    ]


def compare_on_flights(
    flights: list[Flight],
    names: Sequence[str],
    form: str,
    note: Callable[[str], None],
) -> FlightComparison:
    """Compare deciders, the first being the reference; `note` is called with what is done next."""
    titles = {name: find(name, form)[0] for name in names}
    note("labels")
    labels = label_flights(flights)
    copies, truth = twins(flights, labels, np.random.default_rng(TWIN_SEED))
    copied = [scored_alike(*pair) for pair in zip(label_flights(copies), labels, strict=True)]
    seen = (flights, labels)
    of_twins = (copies, copied)
    if form == SEMI_REAL:
        seen = semi_real_flights(*seen, np.random.default_rng(NOISE_SEED))
        of_twins = semi_real_flights(*of_twins, np.random.default_rng(TWIN_NOISE_SEED))
    stated = state_modes(seen[0], titles, form, note)
    of_copies = state_modes(
        of_twins[0],
        titles,
        form,
        lambda title: note(f"twins, {title}"),
    )
    scores, twin_scores = (
        {name: score_flights(titles[name], *where, told[name]) for name in names}
        for where, told in (
            (seen, stated),
            (of_twins, of_copies),
        )
    )
    result = FlightComparison(form, titles, *seen, stated, scores, twin_scores)
    if form == SEMI_REAL:
        return result
    of_truth = score_flights(
        "truth",
        flights,
        copied,
        [label.modes for label in truth],
    )
    modes = [late_modes(*pair) for pair in zip(flights, labels, strict=True)]
    late = score_flights("late", flights, labels, modes)
    return replace(result, truth=of_truth, late=late)


def state_modes(
    flights: Sequence[Flight],
    titles: Mapping[str, str],
    form: str,
    note: Callable[[str], None],
) -> dict[str, list[IntArray]]:
    """Return the statements of each decider on each flight, (n,); 0 outside of its pieces."""
    stated = {}
    batch = stack_flights(flights)
    lengths = [len(flight.times) for flight in flights]
    imm = None if form == SEMI_REAL else run_turn_imm(batch)
    for name, title in titles.items():
        note(title)
        decider = find(name, form)[1]
        if imm is None:
            stated[name] = state_semi_real(decider, flights)
            continue
        beam = split_threshold(name)[0] == "beam"
        tracks = FlightTracks(batch, imm, run_turn_beam(batch) if beam else None)
        modes = (
            decider.statements(tracks)[..., 0]
            if isinstance(decider, FlightAgent)
            else tracks.statements_of(decider)
        )
        stated[name] = batch.unstack(modes, lengths)
    return stated


def late_modes(flight: Flight, labels: Labels) -> IntArray:
    """Return the labels (n,), stated one position late in each piece of the flight."""
    rows = np.arange(len(flight.times))
    for first, end in flight.pieces:
        rows[first + 1 : end] -= 1
    return labels.modes[rows]


def value(scores: Scores, name: str = "agreement") -> float:
    """Return a figure of some flights."""
    return float(scores.curve(STATISTICS[name])[0])


def cell(estimate: Estimate | None, digits: int, scale: float = 1.0) -> str:
    """Return an estimate with its interval; "-" where nothing is counted."""
    if estimate is None or not np.isfinite(estimate.value):
        return "-"
    numbers = (estimate.value, estimate.low, estimate.high)
    middle, low, high = (f"{scale * number:.{digits}f}" for number in numbers)
    return f"{middle} ({low} to {high})"


def figure(scores: Scores, name: str, digits: int = 1, scale: float = 1.0) -> str:
    """Return a figure of some flights with its interval."""
    return cell(scores.estimate(STATISTICS[name]), digits, scale)


def less_first(scores: Mapping[str, Scores], name: str, rows: Sequence[int]) -> Estimate | None:
    """Return the agreement of a decider on some flights less that of the first decider; None for
    that one.
    """
    first = next(iter(scores))
    if name == first:
        return None
    mine = scores[name].some(rows)
    reference = scores[first].some(rows)
    return mine.difference(reference, STATISTICS["agreement"])


def tables(result: FlightComparison) -> dict[str, pd.DataFrame]:
    """Return the tables of a comparison by their titles."""
    rows = []
    of_labels = []
    for tier, group in result.groups.items():
        for name, label in result.names.items():
            scores = result.scores[name].some(group)
            rows.append(
                {
                    "tier": tier,
                    "hours": f"{scores.of('scored', 0).sum() / 3600.0:.1f}",
                    "decider": label,
                    "agreement": figure(scores, "agreement", 3),
                    "less first, points": cell(
                        less_first(result.scores, name, group),
                        1,
                        100.0,
                    ),
                    "delay, s": figure(scores, "delay"),
                    "misses, %": figure(scores, "misses", scale=100.0),
                    "false/h": figure(scores, "false_per_hour"),
                    "to turns": f"{value(scores, 'false_turns_per_hour'):.1f}",
                    "changes/label": f"{value(scores, 'changes_per_label'):.2f}",
                    "twins": f"{value(result.twins[name].some(group)):.3f}",
                }
            )
        if result.truth is not None and result.late is not None:
            late = result.late.some(group)
            of_labels.append(
                {
                    "tier": tier,
                    "true for twins": f"{value(result.truth.some(group)):.3f}",
                    "stated one position late": f"{value(late):.3f}",
                    "delay, s": f"{value(late, 'delay'):.1f}",
                    "false/h": f"{value(late, 'false_per_hour'):.1f}",
                }
            )
    found = {f"Recorded flights, {result.form}": pd.DataFrame(rows)}
    return found | ({"The labels themselves": pd.DataFrame(of_labels)} if of_labels else {})


def estimates(scores: Scores) -> dict[str, Any]:
    """Return all figures with their intervals by name, as plain values."""
    return {name: scores.estimate(statistic).as_json() for name, statistic in STATISTICS.items()}


def as_json(result: FlightComparison) -> dict[str, Any]:
    """Return the figures of every tier, and the agreement on every flight, as plain values."""
    tiers: dict[str, Any] = {}
    for tier, rows in result.groups.items():
        tiers[tier] = {}
        for name, scores in result.scores.items():
            less = less_first(result.scores, name, rows)
            tiers[tier][name] = estimates(scores.some(rows)) | {
                "agreement_less_first": None if less is None else less.as_json(),
                "twins": estimates(result.twins[name].some(rows)),
            }
    flights = {
        flight.identity: {name: value(scores.some([k])) for name, scores in result.scores.items()}
        for k, flight in enumerate(result.flights)
    }
    return {
        "form": result.form,
        "tiers": tiers,
        "agreement": flights,
    }


def picture(result: FlightComparison, k: int) -> Figure:
    """Draw labels of a flight, and statements of the deciders, the last one first."""
    flight, labels = result.flights[k], result.labels[k]
    stated = {label: result.stated[name][k] for name, label in reversed(result.names.items())}
    agrees = value([*result.scores.values()][-1].some([k]))
    return flight_figure(
        flight,
        np.where(labels.scored, labels.modes, len(MODE_NAMES)),
        stated,
        f"{flight.identity}, tier {flight.tier.name}: {next(iter(stated))} agrees {agrees:.1%}",
    )
