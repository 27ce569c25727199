"""Comparison of deciders for unknown switch moments: threshold sweeps, and evaluation on common tracks."""

import functools
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

from agents.evaluation.deciders import SHIPPED, DeciderFamily
from agents.evaluation.operating_curve import Estimate
from agents.evaluation.statement_curve import (
    FULL_DELAY,
    MEAN_DELAY,
    MISSED_SHARE,
    REWARD,
    RIGHT,
    UNDEFINED,
    WRONG_CHANGES,
    StatementCurve,
    TrackMetrics,
    at_wrong_changes,
    check_tracks,
    mean_of,
    sweep_statements,
)
from agents.evaluation.statement_deciders import RULES, statement_family
from agents.evaluation.statement_table import StatementFigures, statement_figures
from agents.interface.parallel import Call, Workers
from baselines.rules import seeds
from hybrid_env.checks import reject
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import make_track_vector_env

EQUAL_WRONG_CHANGES = 2.0
"""Wrong changes per 1,000 ticks at which delays are compared."""
EQUAL_STATISTICS = {
    name: at_wrong_changes(EQUAL_WRONG_CHANGES, statistic)
    for name, statistic in (("full_delay", FULL_DELAY), ("delay", MEAN_DELAY), ("missed", MISSED_SHARE))
}
"""Figures at that rate, by their names in `STATISTICS`."""


@dataclass(frozen=True)
class StatementPlan:
    """Settings of a comparison.

    Attributes:
        env_id: registered id of the environment.
        options: keyword arguments of the environment, which override those of the id.
        deciders: names of classical rules; the first is the reference.
        agents: 'shipped' or run folders.
        tracks: number of tracks that all figures are reported on.
        seed: of the first of them.
        selection_tracks: number of separate tracks for the selection of thresholds.
    """

    env_id: str
    options: dict[str, Any]
    deciders: tuple[str, ...]
    agents: tuple[str, ...]
    tracks: int
    seed: int
    selection_tracks: int

    def world(self) -> QuickestOptions:
        """All options of the environment, including the defaults of the id."""
        world = make_track_vector_env(self.env_id, 1, **self.options).options
        assert isinstance(world, QuickestOptions)
        return world

    def families(self) -> list[DeciderFamily]:
        """The deciders to compare.

        Raises:
            ArgumentError: a name or an option is unknown, a run folder cannot be read, or there are too many
                tracks.
        """
        world = self.world()
        check_tracks("episodes", self.tracks, world)
        check_tracks("selection-episodes", self.selection_tracks, world)
        for name in self.deciders:
            if name not in RULES:
                raise reject("deciders", name, ", ".join(RULES))
        for name in self.agents:
            if name != SHIPPED and not Path(name).is_dir():
                raise reject("agents", name, "'shipped' or a run folder")
        return [statement_family(name, world) for name in (*self.deciders, *self.agents)]


@dataclass(frozen=True)
class StatementEntry:
    """Results of one decider.

    Attributes:
        curve: operating curve on the reported tracks.
        chosen: index of the threshold with the largest mean reward on the selection tracks.
        selection_reward: that reward.
        figures: at that threshold.
        equal: figures at `EQUAL_WRONG_CHANGES`, with the keys of `EQUAL_STATISTICS`; infinite if the decider
            never has so few.
    """

    curve: StatementCurve
    chosen: int
    selection_reward: float
    figures: StatementFigures
    equal: dict[str, Estimate]

    @property
    def name(self) -> str:
        """Name of the decider in tables and figures."""
        return self.curve.family.name


@dataclass(frozen=True)
class StatementComparison:
    """Result of a comparison.

    Attributes:
        plan: settings.
        world: options of the environment.
        entries: results of each decider, rules first; the first is the reference.
    """

    plan: StatementPlan
    world: QuickestOptions
    entries: tuple[StatementEntry, ...]

    @property
    def rules(self) -> tuple[StatementEntry, ...]:
        """Entries of the classical rules."""
        return self.entries[: len(self.plan.deciders)]

    @property
    def best_rule(self) -> StatementEntry:
        """The classical rule with the largest mean reward on the selection tracks."""
        return max(self.rules, key=lambda entry: entry.selection_reward)

    @property
    def best(self) -> StatementEntry:
        """The best of the agents on the selection tracks, or without agents the best rule."""
        agents = self.entries[len(self.plan.deciders) :]
        return max(agents or self.rules, key=lambda entry: entry.selection_reward)

    @cached_property
    def differences(self) -> tuple[Estimate | None, ...]:
        """Paired difference of the mean reward of each decider to that of the best rule, None for that."""
        best = self.best_rule
        return tuple(
            None
            if entry is best
            else entry.curve.at(entry.chosen).difference(best.curve.at(best.chosen), mean_of(REWARD))
            for entry in self.entries
        )

    @cached_property
    def ratios(self) -> tuple[dict[str, Estimate], ...]:
        """Paired ratios of both mean delays at `EQUAL_WRONG_CHANGES` to those of the reference."""
        reference = self.entries[0].curve
        return tuple(
            {name: entry.curve.ratio(reference, EQUAL_STATISTICS[name]) for name in ("full_delay", "delay")}
            for entry in self.entries
        )

    def largest_difference(self) -> int:
        """Index of the track on which the rewards of `best` and of the reference differ most."""
        one, other = (
            entry.curve.metrics[entry.chosen].rows[:, REWARD] for entry in (self.best, self.entries[0])
        )
        return int(np.abs(one - other).argmax())

    def as_json(self) -> dict[str, Any]:
        """Contents of the tables and figures, with every point of the curves."""
        return {
            "plan": asdict(self.plan),
            "selection": {"seed": seeds.SELECTION, "tracks": self.plan.selection_tracks},
            "best_rule": self.best_rule.name,
            "equal_wrong_changes": EQUAL_WRONG_CHANGES,
            "deciders": [self._entry_json(index) for index in range(len(self.entries))],
        }

    def _entry_json(self, index: int) -> dict[str, Any]:
        entry, difference = self.entries[index], self.differences[index]
        curve = {
            "reward": mean_of(REWARD), "right": mean_of(RIGHT), "wrong_changes": mean_of(WRONG_CHANGES),
            "delay": MEAN_DELAY, "full_delay": FULL_DELAY, "missed": MISSED_SHARE,
        }  # fmt: skip
        return entry.figures.as_json() | {
            "reward_less_best_rule": None if difference is None else difference.as_json(),
            "at_equal_wrong_changes": {name: one.as_json() for name, one in entry.equal.items()},
            "ratio_to_reference": {name: ratio.as_json() for name, ratio in self.ratios[index].items()},
            "curve": {"thresholds": list(entry.curve.family.thresholds)}
            | {
                name: [float(x) if x < UNDEFINED else None for x in entry.curve.values(statistic)]
                for name, statistic in curve.items()
            },
        }


def compare_statements(plan: StatementPlan, workers: Workers, progress: Progress) -> StatementComparison:
    """Evaluate and compare the deciders of a plan."""
    families, world = plan.families(), plan.world()
    task = progress.add_task("Evaluating", total=2 * len(families), note="")
    ended = 0

    def show(share: float) -> None:
        progress.update(task, completed=ended + share)

    def count(call: tuple[int, int]) -> None:
        nonlocal ended
        ended += 1
        progress.update(task, completed=ended, note=families[call[0]].name)

    calls: dict[tuple[int, int], Call] = {
        (position, seed): functools.partial(
            _sweep, plan, position, tracks, seed, None if workers.parallel else show
        )
        for position in range(len(families))
        for tracks, seed in ((plan.selection_tracks, seeds.SELECTION), (plan.tracks, plan.seed))
    }
    swept = dict(workers.results(calls, count))
    progress.update(task, note="")
    task = progress.add_task("Intervals", total=len(families), note="")
    entries = []
    for position, family in enumerate(families):
        selection, curve = (
            StatementCurve(family, swept[position, seed]) for seed in (seeds.SELECTION, plan.seed)
        )
        chosen = selection.best_index()
        reward = float(selection.values(mean_of(REWARD))[chosen])
        equal = {name: curve.estimate(statistic) for name, statistic in EQUAL_STATISTICS.items()}
        entries.append(StatementEntry(curve, chosen, reward, statement_figures(curve.at(chosen)), equal))
        progress.advance(task)
    return StatementComparison(plan, world, tuple(entries))


def _sweep(
    plan: StatementPlan, position: int, tracks: int, seed: int, show: Callable[[float], None] | None
) -> tuple[TrackMetrics, ...]:
    """Return the metrics of the decider at a position of a plan, one item per threshold."""
    name = (*plan.deciders, *plan.agents)[position]
    return sweep_statements(statement_family(name, plan.world()), plan.world(), tracks, seed, show).metrics
