"""The agent for flights of gliders: that for flights, with the climb rate as a further input."""

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.learned.flight_decider import INPUTS, FlightAgent, flight_inputs
from agents.learned.statement_net import StatementNet
from baselines.estimation.turns import STRAIGHT, Batch, TurnEstimates
from baselines.rules.circling import GliderClimb
from baselines.rules.decider import GLIDERS, Actions, SeveralThresholds

# Turn rate of the input 1 [deg/s].
UNIT = 16.0
# [m/s]
LARGEST_CLIMB, CLIMB_UNIT = 5.0, 3.0


class GliderAgent(FlightAgent, SeveralThresholds):
    """The network on flights of gliders, at K settings.

    Args:
        net: trained network.
        settings: K pairs, added to the utility of keeping a statement: of straight flight, and of
            circles; or one number for both.
    """

    task = GLIDERS
    inputs = INPUTS + 1
    model = GliderClimb.models[1]
    grid = tuple(
        product(
            map(float, (0, 1, 2, 3, 4, 6, 8, 10, 13, 16)),
            map(float, (-8, -6, *range(-4, 3), 4, 8)),
        )
    )
    """Settings to select from."""

    def __init__(self, net: StatementNet, *settings: tuple[float, float] | float):
        super().__init__(net)
        pairs = [np.broadcast_to(one, 2) for one in settings or (0.0,)]
        # (K,)
        self.enter, self.leave = np.array(pairs, np.float64).T
        self.chosen = []

    @staticmethod
    def inputs_of(batch: Batch, estimates: TurnEstimates) -> NDArray[np.float32]:
        """See `FlightAgent.inputs_of`; the last one is the climb rate."""
        climbs = np.zeros_like(batch.times) if batch.climbs is None else batch.climbs
        climb = np.clip(climbs, -LARGEST_CLIMB, LARGEST_CLIMB)[..., None, None] / CLIMB_UNIT
        others = flight_inputs(batch, estimates, UNIT)
        return np.concatenate([others, np.broadcast_to(climb, (*others.shape[:3], 1))], -1).astype(
            np.float32
        )

    def decide(self, observation: Any, state: Any, episode_start: Any) -> tuple[Actions, Actions]:
        """See `FlightAgent.decide`; the state is (N, K)."""
        stated = np.full((len(observation), len(self.enter)), STRAIGHT) if state is None else state
        keep = observation[:, 3, None] + np.where(stated == STRAIGHT, self.enter, self.leave)
        kept = stated[..., None] == np.arange(3)
        stated = (observation[:, None, :3] + np.where(kept, keep[..., None], 0.0)).argmax(-1)
        self.chosen = list(stated.T)
        return self.chosen[0], stated
