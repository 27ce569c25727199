"""What moves in simulators of others in place of the object of `HybridTrackQuickest-v0`."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from agents.evaluation.task import Recorded
from agents.evaluation.unknown import UnknownTask
from baselines.recordings.simulators.process_noise import FACTORS
from baselines.recordings.simulators.tracks import (
    MINUTES,
    VEHICLES,
    simulated_tracks,
    world_options,
)
from baselines.rules.rollout import record_in
from hybrid_env.quickest_options import QuickestOptions

SIMULATORS = tuple(dict.fromkeys(one.module for one in VEHICLES.values()))
"""Python modules of the simulators."""

COMPARED = ("robust", "threshold", "beam", "beam-geometric", "cusum")
"""Deciders that are compared by default, the agent first."""

PROCESS_FACTORS = (0.1, 10.0)
"""Process noise that is tried besides the nominal one, as factors: what rolls or brakes fits no
model.
"""

LIKELIEST = "likeliest"
"""Key of the change that the process noise is that of the largest evidence, see `process_noise`."""


@dataclass(frozen=True)
class SimulatorTask(UnknownTask):
    """Paths of one kind with noise; its options are what deciders are told.

    Attributes:
        kind: key of `VEHICLES`.
        likeliest: whether rows are those of the likeliest process noise.
    """

    kind: str = ""
    likeliest: bool = False

    def size(self, episodes: int) -> str:
        """See `Task.size`."""
        return f"{episodes * MINUTES / 60.0:g} h"

    def settings(self, observes: str) -> Sequence[Mapping[str, Any]]:
        """See `Task.settings`: other process noise; for deciders that read rows also the
        likeliest one.
        """
        Q = self.options.process_variance
        others = ({"process_variance": factor * Q} for factor in PROCESS_FACTORS)
        return ({}, *others, *([self.untuned] if observes == "rows" else []))

    @property
    def untuned(self) -> Mapping[str, Any]:
        """See `Task.untuned`: the likeliest process noise."""
        return {LIKELIEST: True}

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """See `Task.changed`."""
        others = {name: value for name, value in changes.items() if name != LIKELIEST}
        return dataclasses.replace(
            super().changed(others),
            likeliest=changes.get(LIKELIEST, self.likeliest),
        )

    def record(
        self,
        deciders: Sequence[Any],
        changes: Mapping[str, Any],
        episodes: int,
        seed: int,
        on_progress: Callable[[float], None],
    ) -> list[Recorded]:
        """See `Task.record`."""
        options = self.options_with(changes)
        assert isinstance(options, QuickestOptions)
        factors = FACTORS if self.likeliest else (1.0,)
        found = record_in(
            lambda: simulated_tracks(self.kind, options, episodes, factors),
            deciders,
            seed,
        )
        return [self.measured(statements) for statements in found]


def simulator_worlds(modules: Sequence[str] = SIMULATORS) -> dict[str, SimulatorTask]:
    """Return the worlds of simulators by name: all that moves in them, at each of its ticks and
    noises.
    """
    return {
        f"{kind}, {tick:g} s, {noise:g} m": SimulatorTask(
            "hybrid_env:HybridTrackQuickest-v0",
            world_options(kind, tick, noise),
            kind,
        )
        for kind, one in VEHICLES.items()
        if one.module in modules
        for tick in one.ticks
        for noise in one.noises
    }
