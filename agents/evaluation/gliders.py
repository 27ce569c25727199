"""Recorded flights of gliders: straight flight, or circles to a side, stated at every position."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from agents.evaluation.flights import rule_or_folder
from agents.evaluation.registry import learned_family
from agents.evaluation.task import Metric
from baselines.estimation.turn_beam import run_turn_beam
from baselines.estimation.turns import TurnModel, run_turn_imm
from baselines.recordings.flights.circling import air_motion, decode, label_glider
from baselines.recordings.flights.flight import Flight, stack_flights
from baselines.recordings.flights.gliders import digits, glider_flight
from baselines.recordings.flights.labels import Labels
from baselines.recordings.flights.metrics import STATISTICS, score_flights
from baselines.recordings.flights.tracks import FlightTracks
from baselines.recordings.reading.igc import parse_igc
from baselines.rules.circling import GliderRule
from baselines.rules.decider import GLIDERS, Decider
from baselines.scoring.scores import Scores
from hybrid_env.checks import IntArray

# Positions that are filtered at once.
PART, MARGIN = 1200, 240

FALSE = STATISTICS["false_per_hour"]
METRICS = (
    Metric("false_per_hour", "false/h", FALSE, 1),
    Metric("enter", "enter\ns", STATISTICS["enter"], 1),
    Metric("leave", "leave\ns", STATISTICS["leave"], 1),
    Metric("misses_in", "misses\nin, %", STATISTICS["misses_in"], 1, 100.0),
    Metric("misses_out", "misses\nout, %", STATISTICS["misses_out"], 1, 100.0),
    Metric("agreement", "agrees\n%", STATISTICS["agreement"], 2, 100.0),
)


class Setting(NamedTuple):
    """A rule at one of its settings."""

    # Of the rule.
    name: str
    # Index of the settings of its filters.
    model: int
    # Of the rule.
    numbers: tuple[float, ...]


class LearnedRule(NamedTuple):
    """The agent of a folder, with what the class of a rule tells; see `GliderRule`."""

    title: str
    models: tuple[TurnModel, ...]
    grid: tuple[tuple[float, ...], ...]
    make: Callable[..., Decider]
    histories: None = None

    def __call__(self, *settings: tuple[float, ...]) -> Decider:
        """Return the agent at settings."""
        return self.make(*settings)


def glider_rule(name: str) -> type[GliderRule] | LearnedRule:
    """Return the class of a rule, or an agent: the shipped one, or that of a folder."""
    found: Any = rule_or_folder(name, GLIDERS)
    if not isinstance(found, Path):
        return found
    from agents.learned.glider_decider import GliderAgent

    return LearnedRule(
        name,
        (GliderAgent.model,),
        GliderAgent.grid,
        learned_family(found, recorded=GLIDERS).make,
    )


def read_gliders(contents: Sequence[bytes], group: str) -> tuple[list[Flight], list[Labels]]:
    """Return the flights of logs and their labels."""
    logs = {digits(content): parse_igc(digits(content), content) for content in contents}
    flights = [glider_flight(name, group, log) for name, log in logs.items()]
    decoded = [decode(log.records) for log in logs.values()]
    return flights, [
        label_glider(*one) for one in zip(flights, air_motion(flights), decoded, strict=True)
    ]


def glider_statements(
    flights: Sequence[Flight],
    settings: Sequence[Setting],
) -> dict[Setting, list[IntArray]]:
    """Return the statements of rules at settings on each flight, (n,)."""
    batch = stack_flights(flights, PART, MARGIN)
    lengths = [len(flight.times) for flight in flights]
    found: dict[Setting, list[IntArray]] = {}
    for name, k in dict.fromkeys((one.name, one.model) for one in settings):
        some = [one for one in settings if (one.name, one.model) == (name, k)]
        rule = glider_rule(name)
        beam = (
            None if rule.histories is None else run_turn_beam(batch, rule.models[k], rule.histories)
        )
        tracks = FlightTracks(batch, run_turn_imm(batch, rule.models[k]), beam)
        stated = tracks.statements_together(
            rule(*(one.numbers for one in some)),
            lengths,
            len(some),
        )
        found |= dict(zip(some, stated, strict=True))
    return found


def all_settings(name: str) -> list[Setting]:
    """Return the settings of a rule to select from."""
    rule = glider_rule(name)
    return [Setting(name, k, numbers) for k in range(len(rule.models)) for numbers in rule.grid]


def score_settings(
    flights: Sequence[Flight],
    labels: Sequence[Labels],
    stated: dict[Setting, list[IntArray]],
) -> Scores:
    """Return the scores of statements, whose thresholds are the indices of the settings."""
    title = glider_rule(next(iter(stated)).name).title
    each = [score_flights(title, flights, labels, one) for one in stated.values()]
    values = np.concatenate([one.values for one in each], axis=-1)
    return Scores(title, "setting", tuple(map(float, range(len(each)))), each[0].columns, values)
