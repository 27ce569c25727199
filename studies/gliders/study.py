"""Rules on flights of gliders at equal false changes: settings selected on one half, scored on
the other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from baselines import Scores, parse_igc
from studies.flights.flight import Flight, stack_flights
from studies.flights.labels import Pair
from studies.flights.rules import TurnRule
from studies.flights.scores import STATISTICS, score_flights
from studies.flights.turns import IntArray, run_turn_imm
from studies.gliders.agent import GliderAgent
from studies.gliders.circling import air_motion, decode, label_glider
from studies.gliders.hindsight import HINDSIGHT
from studies.gliders.logs import HALVES, SEALED, glider_flight, read_logs
from studies.gliders.rules import RULES
from studies.gliders.simulated import label_gliders, simulate_glider

LEVELS = (2.0, 5.0, 8.0)
"""False changes an hour at which rules are compared; the middle one is that of the pictures."""
FOR_DELAYS = {"imm-delays": RULES["imm"], "imm-climb-delays": RULES["imm-climb"]}
"""Rules at the setting with the smallest delays, where other rules have that with the best
agreement.
"""
AFTER_SEAL = FOR_DELAYS | HINDSIGHT
"""Rules of whose settings the seal knows nothing."""
DECIDERS = RULES | AFTER_SEAL
"""All rules by name; the first is the reference."""


class Setting(NamedTuple):
    """A rule at one of its settings."""

    # Name of the rule.
    name: str
    # Index of the settings of its filters.
    model: int
    # Numbers of the rule.
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


def find_rule(name: str) -> TurnRule:
    """Return a rule, the shipped agent, or the agent of a folder.

    Raises:
        ArgumentError: there is none of this name.
    """
    return DECIDERS[name] if name in DECIDERS else GliderAgent.rule(name, DECIDERS)


def glider_statements(flights: Sequence[Flight], settings: Sequence[Setting]) -> list[IntArray]:
    """Return the statements (n, K) of a rule at K settings on each flight; 0 outside of its
    pieces.
    """
    batch = stack_flights(flights, 1200, 240)
    rule = find_rule(settings[0].name)
    stated = np.zeros((*batch.times.shape, len(settings)), "int8")
    for k in {setting.model for setting in settings}:
        columns = [column for column, setting in enumerate(settings) if setting.model == k]
        numbers = [settings[column].numbers for column in columns]
        estimates = run_turn_imm(batch, rule.models[k])
        stated[..., columns] = rule.statements(batch, estimates, numbers, rule.models[k])
    return batch.unstack(stated)


def select(scores: Scores, rows: Sequence[int], level: float, for_delays: bool = False) -> int:
    """Return the best setting on some flights among those with few enough false changes an hour.

    The best setting has the largest agreement. For delays it has the smallest sum of the mean delay
    of entering and that of leaving.
    """
    false, agreement, enter, leave = (
        scores.some(rows).curve(STATISTICS[name])
        for name in ("false_per_hour", "agreement", "enter", "leave")
    )
    # A setting that never states a circle has no delay.
    worth = np.nan_to_num(-(enter + leave), nan=-np.inf) if for_delays else agreement
    allowed = false <= max(level, false.min())
    return int(np.where(allowed, worth, -np.inf).argmax())


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
    pairs = simulated(4, 900.0, 20260602)
    return [
        (replace(flight, identity=f"simulated {k}", tier=flight.tier._replace(name=half)), labels)
        for (k, (flight, labels)), half in zip(enumerate(pairs), "AABB", strict=True)
    ]


def compare_rule(
    name: str, flights: list[Pair], copies: list[Pair], sealed: Mapping[str, Any]
) -> RuleResults:
    """Return the results of a rule.

    Args:
        name: of the rule.
        flights: with their labels; their tiers are their halves.
        copies: simulated flights.
        sealed: settings of the seal for the sealed flights, by level and name; without any, and for
            rules that came after the seal, they are selected on all halves.
    """
    plain = [flight for flight, _ in flights]
    halves = [flight.tier.name for flight in plain]
    rule = find_rule(name)
    settings = [Setting(name, k, numbers) for k in range(len(rule.models)) for numbers in rule.grid]
    # All settings on all flights, before any is selected.
    stated = glider_statements(plain, settings)
    swept = score_flights(flights, stated)
    chosen: dict[float, dict[str, int]] = {level: {} for level in LEVELS}
    for level, best in chosen.items():
        for half in (*HALVES, SEALED):
            others = [k for k, other in enumerate(halves) if other not in (half, SEALED)]
            best[half] = select(swept, others, level, name in FOR_DELAYS)
        if sealed and name not in AFTER_SEAL:
            _, model, numbers = sealed[f"{level:g}"][name]
            best[SEALED] = settings.index(Setting(name, model, tuple(numbers)))
    columns = {level: [best[half] for half in halves] for level, best in chosen.items()}
    used = [settings[best[SEALED]] for best in chosen.values()]
    on_copies = score_flights(copies, glider_statements([flight for flight, _ in copies], used))
    return RuleResults(
        [modes[:, k] for modes, k in zip(stated, columns[LEVELS[1]], strict=True)],
        {
            level: replace(swept.at(0), values=swept.values[range(len(halves)), :, some][..., None])
            for level, some in columns.items()
        },
        {level: {half: settings[k] for half, k in best.items()} for level, best in chosen.items()},
        {level: on_copies.at(k) for k, level in enumerate(LEVELS)},
    )
