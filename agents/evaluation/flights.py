"""Recorded flights: a mode is stated at every position, and compared with labels by hindsight."""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from agents.evaluation.cells import bounds_cell
from agents.evaluation.registry import (
    SHIPPED,
    find_decider,
    learned_family,
    policy_folder,
    split_threshold,
)
from agents.evaluation.task import Metric
from baselines.estimation.turn_beam import run_turn_beam
from baselines.estimation.turns import run_turn_imm
from baselines.recordings.flights.flight import SCORED, Flight, stack_flights
from baselines.recordings.flights.labels import Labels
from baselines.recordings.flights.metrics import STATISTICS
from baselines.recordings.flights.samples import Samples
from baselines.recordings.flights.semi_real import WORLD, semi_real_flights, state_semi_real
from baselines.recordings.flights.tracks import FlightTracks
from baselines.rules.decider import FLIGHTS, UNKNOWN, Decider, DeciderFamily, rules
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores
from hybrid_env.checks import IntArray, reject

NATIVE, SEMI_REAL = "native", "semi-real"
AGENT = "agent"
COMPARED = {NATIVE: ("imm", "imm:0.8", "cusum", "beam", "agent:8", AGENT), SEMI_REAL: None}
"""Deciders that are compared by default; in the semi-real form all rules and the shipped agent."""

METRICS = (
    Metric("agreement", "agreement", STATISTICS["agreement"], 3),
    Metric("delay", "delay\ns", STATISTICS["delay"], 1),
    Metric("misses", "misses\n%", STATISTICS["misses"], 1, 100.0),
    Metric("false_per_hour", "false/h\n(turns)", STATISTICS["false_per_hour"], 1),
    Metric("false_turns_per_hour", "false turns\nper hour", STATISTICS["false_turns_per_hour"], 1),
    Metric("changes_per_label", "changes\nper label", STATISTICS["changes_per_label"], 2),
)

SECOND_LINES = "Second lines: 95 % interval, flights drawn with replacement."


def value(scores: Scores, name: str = "agreement") -> float:
    """Return a figure of some flights."""
    return float(scores.curve(STATISTICS[name])[0])


def figure_cell(scores: Scores, metric: Metric, bracketed: str = "") -> str:
    """Return a figure, in brackets another one, and below it its interval; one digit less from
    10 on.
    """

    def short(number: float) -> str:
        digits = metric.digits - (round(abs(number), metric.digits) >= 10.0)
        return f"{number:.{digits}f}" if np.isfinite(number) else "-"

    found, low, high = (
        short(metric.scale * one) for one in vars(scores.estimate(metric.statistic)).values()
    )
    other = f" ({short(value(scores, bracketed))})" if bracketed else ""
    return f"{found}{other}\n{low}-{high}"


def less_first(scores: Mapping[str, Scores], name: str, rows: list[int]) -> Estimate | None:
    """Return the agreement of a decider on some flights less that of the first decider; None for
    that one.
    """
    first = next(iter(scores))
    agreement = STATISTICS["agreement"]
    return (
        None
        if name == first
        else scores[name].some(rows).difference(scores[first].some(rows), agreement)
    )


def less_cell(less: Estimate | None) -> str:
    """Return what `less_first` returns in percentage points."""
    return "" if less is None else bounds_cell(less, 1, 100.0)


def rule_or_folder(name: str, task: str) -> Any:
    """Return the class of a rule for recorded flights, or the folder of an agent: the shipped
    one, or another.
    """
    known = rules(task)
    if name in known:
        return known[name]
    folder = policy_folder(SHIPPED if name == AGENT else name, task)
    if not folder.is_dir():
        raise reject(
            "deciders",
            name,
            f"{', '.join((*known, AGENT))} with --{task}, or the folder of an agent",
        )
    return folder


@dataclass(frozen=True)
class FlightTask:
    """What is decided on recorded flights.

    The form "native" is the positions as reported, with filters for turn rates; "semi-real" their
    smoothed path with white noise in the setting of HybridTrackQuickest-v0, with its deciders.
    """

    # Folder or wheel of the package `traffic`; None for the installed package.
    source: Path | None
    # Of the flights; without any those of `SCORED`.
    identities: tuple[str, ...]
    # Names of the tiers; of the default flights only these are used.
    tiers: tuple[str, ...]
    form: str

    @property
    def compared(self) -> tuple[str, ...]:
        """Names of the deciders that are compared by default, the reference first."""
        return COMPARED[self.form] or tuple(dict.fromkeys(("threshold", *rules(UNKNOWN), SHIPPED)))

    def label(self, name: str) -> str:
        """Return the name of a decider in figures."""
        base, threshold = split_threshold(name)
        # Refuses a threshold that is not allowed.
        self.decider(name)
        title = self._find(name)[0].name
        margin = ", margin" if base == AGENT else ""
        return title if threshold is None else f"{title}{margin} {threshold:g}"

    def decider(self, name: str) -> Decider:
        """Return the decider of a name with an optional threshold."""
        family, threshold = self._find(name)
        made: Decider = family.make(threshold)
        return made

    def _find(self, name: str) -> tuple[DeciderFamily, float]:
        """Return the family, named as in figures, and the threshold of a name with an optional
        one.
        """
        if self.form == SEMI_REAL:
            return find_decider(name, WORLD)
        base, given = split_threshold(name)
        found = rule_or_folder(base, FLIGHTS)
        own = isinstance(found, Path)
        family = (
            replace(learned_family(found), name=base, default=0.0) if own else found.family(None)
        )
        return family, family.default if given is None else given

    def read(self) -> list[Flight]:
        """Return the flights of the tiers."""
        samples = Samples(self.source)
        wanted = self.identities or tuple(one for tier in self.tiers for one in SCORED[tier])
        # Those of a file one after the other.
        found = {name: samples.flight(name) for name in sorted(set(wanted))}
        flights = [
            found[name] for name in dict.fromkeys(wanted) if found[name].tier.name in self.tiers
        ]
        if not flights:
            raise reject("tier", self.tiers, "tiers of the flights")
        return flights

    def convert(
        self,
        flights: Sequence[Flight],
        labels: Sequence[Labels],
        seed: int,
    ) -> tuple[list[Flight], list[Labels]]:
        """Return flights and labels in the form of the task; the seed is that of the noise."""
        if self.form == SEMI_REAL:
            return semi_real_flights(flights, labels, np.random.default_rng(seed))
        return list(flights), list(labels)

    def statements(self, flights: Sequence[Flight]) -> Callable[[str], list[IntArray]]:
        """Return a function from the name of a decider to its statements on each flight, (n,)."""
        if self.form == SEMI_REAL:
            return lambda name: state_semi_real(self.decider(name), flights)
        batch = stack_flights(flights)
        imm = functools.cache(lambda: FlightTracks(batch, run_turn_imm(batch)))
        beam = functools.cache(lambda: FlightTracks(batch, imm().estimates, run_turn_beam(batch)))

        def state(name: str) -> list[IntArray]:
            decider = self.decider(name)
            tracks = beam() if rules(FLIGHTS).get("beam") is type(decider) else imm()
            return tracks.statements(decider, [len(flight.times) for flight in flights])

        return state
