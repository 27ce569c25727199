"""The agent for flights of gliders: that for flights, with the climb rate as a further input."""

from itertools import product
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from studies.flights.agent import INPUTS, FlightAgent, flight_inputs
from studies.flights.turns import Batch, TurnEstimates
from studies.gliders.rules import GliderClimb

# Turn rate of the input 1 [deg/s].
UNIT = 16.0
# [m/s]
LARGEST_CLIMB, CLIMB_UNIT = 5.0, 3.0


class GliderAgent(FlightAgent):
    """The network on flights of gliders, at K settings; see `FlightAgent`."""

    task = "gliders"
    inputs = INPUTS + 1
    model = GliderClimb.models[1]
    grid: ClassVar[tuple[tuple[float, float], ...]] = tuple(
        product(
            map(
                float,
                (0, 1, 2, 3, 4, 6, 8, 10, 13, 16),
            ),
            map(
                float,
                (-8, -6, *range(-4, 3), 4, 8),
            ),
        )
    )
    """Settings to select from."""

    @classmethod
    def inputs_of(cls, batch: Batch, estimates: TurnEstimates) -> NDArray[np.float32]:
        """See `FlightAgent.inputs_of`; the last one is the climb rate."""
        climbs = np.zeros_like(batch.times) if batch.climbs is None else batch.climbs
        climb = np.clip(climbs, -LARGEST_CLIMB, LARGEST_CLIMB)[..., None, None] / CLIMB_UNIT
        others = flight_inputs(batch, estimates, UNIT)
        further = np.broadcast_to(climb, (*others.shape[:3], 1))
        return np.concatenate([others, further], axis=-1).astype(np.float32)
