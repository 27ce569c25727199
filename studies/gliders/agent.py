"""The agent for flights of gliders: that for flights, with the climb rate as a further input."""

from pathlib import Path

import numpy as np

from studies.flights.agent import FlightAgent, Inputs
from studies.flights.turns import Batch, TurnEstimates
from studies.gliders.rules import CLIMBING


class GliderAgent(FlightAgent):
    """The network on flights of gliders; see `FlightAgent`."""

    task = "gliders"
    inputs = FlightAgent.inputs + 1
    model = CLIMBING[1]
    shipped = Path(__file__).with_name("shipped")
    unit = 16.0
    grid = tuple(
        (float(straight), float(turn))
        for straight in (0, 1, 2, 3, 4, 6, 8, 10, 13, 16)
        for turn in (-8, -6, *range(-4, 3), 4, 8)
    )

    @classmethod
    def inputs_of(cls, batch: Batch, estimates: TurnEstimates) -> Inputs:
        """See `FlightAgent.inputs_of`; the last one is the climb rate, at most 5 m/s."""
        climb = np.clip(batch.climbs, -5.0, 5.0)[..., None, None] / 3.0
        others = super().inputs_of(batch, estimates)
        further = np.broadcast_to(climb, (*others.shape[:3], 1))
        return np.concatenate([others, further], axis=-1).astype(np.float32)
