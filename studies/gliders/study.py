"""Rules on flights of gliders at equal false changes: settings selected on one half, scored on
the other.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import joblib
import numpy as np

from baselines import Scores, parse_igc
from studies.flights.flight import Flight, stack_flights
from studies.flights.labels import Pair
from studies.flights.scores import score_flights, value
from studies.flights.tracks import FlightTracks
from studies.flights.turn_beam import run_turn_beam
from studies.flights.turns import IntArray, run_turn_imm
from studies.gliders.agent import GliderAgent
from studies.gliders.circling import air_motion, decode, label_glider
from studies.gliders.logs import HALVES, SEALED, glider_flight, read_logs
from studies.gliders.rules import RULES, GliderRule
from studies.gliders.simulated import label_gliders, simulate_glider

LEVELS = (2.0, 5.0, 8.0)
"""False changes an hour at which rules are compared; the middle one is that of the pictures."""


class Setting(NamedTuple):
    """A rule at one of its settings."""

    # Of the rule.
    name: str
    # Index of the settings of its filters.
    model: int
    # Of the rule.
    numbers: tuple[float, ...]


class RuleResults(NamedTuple):
    """Results of a rule."""

    # Statements (n,) on each flight at the middle level.
    stated: list[IntArray]
    # By level; each flight has the setting that was selected without its half.
    scores: dict[float, Scores]
    # Settings by level and half that they are scored on, or `SEALED`: selected on all halves.
    chosen: dict[float, dict[str, Setting]]
    # Scores on simulated flights by level, with the settings that were selected on all halves.
    simulated: dict[float, Scores]


@dataclass(frozen=True, eq=False)
class GliderComparison:
    """Results."""

    flights: list[Pair]
    # Simulated flights.
    copies: list[Pair]
    # By name.
    rules: dict[str, RuleResults]

    @property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the open flights, and of the sealed ones."""
        groups: dict[str, list[int]] = {}
        for k, (flight, _) in enumerate(self.flights):
            name = SEALED if flight.tier.name == SEALED else "both halves"
            groups.setdefault(name, []).append(k)
        return groups

    def at(self, level: float) -> dict[str, Scores]:
        """Return the scores of all rules at a level."""
        return {name: results.scores[level] for name, results in self.rules.items()}


def find_rule(name: str) -> GliderRule:
    """Return a rule, the shipped agent, or the agent of a folder.

    Raises:
        ArgumentError: there is none of this name.
    """
    if name in RULES:
        return RULES[name]
    make: Callable[..., Any] = GliderAgent.find(name, RULES)
    return GliderRule(
        title=name,
        state=lambda tracks, settings: make(*settings).statements(tracks),
        grid=GliderAgent.grid,
        models=(GliderAgent.model,),
    )


def glider_statements(
    flights: Sequence[Flight],
    settings: Sequence[Setting],
) -> dict[Setting, list[IntArray]]:
    """Return the statements of a rule at settings on each flight, (n,); 0 outside of its pieces."""
    batch = stack_flights(flights, 1200, 240)
    rule = find_rule(settings[0].name)
    stated: dict[Setting, list[IntArray]] = {}
    for k in dict.fromkeys(setting.model for setting in settings):
        some = [setting for setting in settings if setting.model == k]
        model = rule.models[k]
        beam = None if rule.beam is None else run_turn_beam(batch, model, **rule.beam)
        tracks = FlightTracks(batch, run_turn_imm(batch, model), beam)
        modes = rule.state(tracks, [setting.numbers for setting in some])
        for column, setting in enumerate(some):
            stated[setting] = batch.unstack(modes[..., column])
    return stated


def select(scores: Mapping[Setting, Scores], rows: Sequence[int], level: float) -> Setting:
    """Return the setting with the best agreement on some flights among those with few enough
    false changes an hour.
    """
    parts = [of_setting.some(rows) for of_setting in scores.values()]
    false, agreement = (
        np.array([value(part, name) for part in parts]) for name in ("false_per_hour", "agreement")
    )
    allowed = false <= max(level, float(false.min()))
    return list(scores)[int(np.where(allowed, agreement, -1.0).argmax())]


def read_halves(source: Path, sealed: bool = False) -> list[Pair]:
    """Return the flights of the open logs of a source with their labels, and the sealed ones."""
    pairs: list[Pair] = []
    for half in (*HALVES, SEALED) if sealed else HALVES:
        logs = {name: parse_igc(name, text) for name, text in read_logs(source, half).items()}
        flights = [glider_flight(name, half, log) for name, log in logs.items()]
        decoded = [decode(log.records) for log in logs.values()]
        labels = map(label_glider, flights, air_motion(flights), decoded)
        pairs += zip(flights, labels, strict=True)
    return pairs


def simulated(count: int = 60, seconds: float = 3600.0, seed: int = 20260601) -> list[Pair]:
    """Return simulated flights with their labels."""
    generator = np.random.default_rng(seed)
    flights = [simulate_glider(seconds, generator) for _ in range(count)]
    return list(zip(flights, label_gliders(flights), strict=True))


def quick_halves() -> list[Pair]:
    """Return short simulated flights in the place of the logs of both halves."""
    return [
        (
            replace(
                flight,
                identity=f"simulated {k}",
                tier=flight.tier._replace(name=half),
            ),
            labels,
        )
        for k, ((flight, labels), half) in enumerate(
            zip(
                simulated(4, 900.0, 20260602),
                "AABB",
                strict=True,
            )
        )
    ]


def compare_on_gliders(
    flights: list[Pair],
    names: Sequence[str],
    copies: list[Pair],
    jobs: int = 1,
    settings: Mapping[str, Any] | None = None,
) -> GliderComparison:
    """Compare rules on flights of gliders, the first being the reference.

    Args:
        flights: with their labels; their tiers are their halves.
        names: of the rules.
        copies: simulated flights.
        jobs: number of processes.
        settings: of the seal for the sealed flights, by level and name; without them they are
            selected on all halves.
    """
    calls = [joblib.delayed(compare_rule)(name, flights, copies, settings or {}) for name in names]
    results = joblib.Parallel(n_jobs=jobs)(calls)
    return GliderComparison(
        flights,
        copies,
        dict(zip(names, results, strict=True)),
    )


def compare_rule(
    name: str,
    flights: list[Pair],
    copies: list[Pair],
    sealed: Mapping[str, Any],
) -> RuleResults:
    """Return the results of a rule; `sealed` is described in `compare_on_gliders`."""
    plain = [flight for flight, _ in flights]
    halves = [flight.tier.name for flight in plain]
    rule = find_rule(name)
    settings = [Setting(name, k, pair) for k in range(len(rule.models)) for pair in rule.grid]
    # All settings on all flights, before any is selected.
    stated = glider_statements(plain, settings)
    swept = {setting: score_flights("", flights, modes) for setting, modes in stated.items()}
    scores = {}
    chosen: dict[float, dict[str, Setting]] = {level: {} for level in LEVELS}
    for level, best in chosen.items():
        for half in (*HALVES, SEALED):
            others = [k for k, other in enumerate(halves) if other not in (half, SEALED)]
            best[half] = select(swept, others, level)
        if sealed:
            _, model, numbers = sealed[f"{level:g}"][name]
            best[SEALED] = Setting(name, model, tuple(numbers))
        values = [swept[best[half]].values[k] for k, half in enumerate(halves)]
        scores[level] = replace(swept[settings[0]], values=np.array(values))
    used = list(dict.fromkeys(best[SEALED] for best in chosen.values()))
    made = glider_statements([flight for flight, _ in copies], used)
    return RuleResults(
        [stated[chosen[LEVELS[1]][half]][k] for k, half in enumerate(halves)],
        scores,
        chosen,
        {level: score_flights("", copies, made[chosen[level][SEALED]]) for level in LEVELS},
    )
