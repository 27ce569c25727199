"""Aircraft of JSBSim in place of the object of `HybridTrackQuickest-v0`: a mode is stated at every tick."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from agents.evaluation.task import Recorded
from agents.evaluation.unknown import UnknownTask
from baselines.recordings.simulators.tracks import MINUTES, VEHICLES, SimulatedTracks, world_options
from baselines.rules.rollout import record_in
from hybrid_env.quickest_options import QuickestOptions

COMPARED = ("shipped", "threshold", "beam", "beam-geometric", "cusum")
"""Deciders that are compared by default, the agent first."""

PROCESS_FACTORS = (0.1, 10.0)
"""Process noise that is tried besides the nominal one, as factors: an aircraft that rolls fits no model."""


@dataclass(frozen=True)
class SimulatorTask(UnknownTask):
    """Flights of an aircraft with noise; its options are what deciders are told.

    Attributes:
        kind: key of `VEHICLES`.
    """

    kind: str = ""

    def size(self, episodes: int) -> str:
        """See `Task.size`."""
        return f"{episodes * MINUTES / 60.0:g} h"

    def settings(self) -> Sequence[Mapping[str, Any]]:
        """See `Task.settings`: other process noise."""
        Q = self.options.process_variance
        return ({}, *({"process_variance": factor * Q} for factor in PROCESS_FACTORS))

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
        found = record_in(lambda: SimulatedTracks(self.kind, options, episodes), deciders, seed)
        return [self.measured(statements) for statements in found]


def simulator_worlds() -> dict[str, SimulatorTask]:
    """Return the worlds by name: every aircraft at each of its ticks and noises."""
    return {
        f"{kind}, {tick:g} s, {noise:g} m": SimulatorTask(
            "hybrid_env:HybridTrackQuickest-v0", world_options(kind, tick, noise), kind
        )
        for kind, one in VEHICLES.items()
        for tick in one.ticks
        for noise in one.noises
    }
