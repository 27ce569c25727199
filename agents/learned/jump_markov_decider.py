"""The jump-Markov net as a decider."""

from typing import Any, NamedTuple

import numpy as np
import torch

from agents.learned.jump_markov_net import JumpMarkovNet, JumpMarkovState, track_inputs
from agents.learned.statement_decider import UtilityDecider
from baselines.rules.decider import Actions
from baselines.rules.measurements import OBSERVED, MeasurementDecider
from hybrid_env.checks import BoolArray, FloatArray, reject
from hybrid_env.quickest_options import QuickestOptions


class JumpMarkovMemory(NamedTuple):
    """State of N tracks.

    Attributes:
        net: of the network.
        stated: (N,) last statements.
    """

    net: JumpMarkovState
    stated: Actions


class JumpMarkovDecider(UtilityDecider, MeasurementDecider[JumpMarkovMemory]):
    """States the mode with the largest utility, from the measurements; the bank gives the first estimate only.

    Args:
        net: trained network.
        world: options of the environment.
        margin: see `UtilityDecider`.
    """

    def __init__(self, net: JumpMarkovNet, world: QuickestOptions, margin: float = 0.0):
        super().__init__(net, margin)
        self.world, self.hypotheses = world, world.hypotheses

    @classmethod
    def network(cls, hidden: int) -> JumpMarkovNet:
        """Return an untrained network with a number of hidden units."""
        return JumpMarkovNet(hidden)

    @torch.no_grad()
    def decide(
        self, observation: FloatArray, state: JumpMarkovMemory | None, episode_start: BoolArray | None
    ) -> tuple[Actions, JumpMarkovMemory]:
        """See `MeasurementDecider.decide`."""
        tracks, M = len(observation), self.hypotheses
        if observation.ndim != 2 or observation.shape[1] < OBSERVED + M:
            raise reject("observation shape", observation.shape, f"(N, {OBSERVED + M})")
        inputs = torch.from_numpy(track_inputs(self.world, observation))
        logs = torch.from_numpy(observation[:, OBSERVED : OBSERVED + M]).float()
        starts = np.zeros(tracks, np.bool_) if episode_start is None else episode_start
        if state is None:
            outputs, net = self.net.begin(inputs, logs)
            state, starts = JumpMarkovMemory(net, np.zeros(tracks, np.int64)), np.ones(tracks, np.bool_)
        else:
            outputs, net = self.net.step(inputs, state.net)
            if starts.any():
                anew, first = self.net.begin(inputs, logs)
                mask = torch.from_numpy(starts)
                net = net.replaced(mask, first)
                utility = torch.where(mask[:, None], anew.utility[0], outputs.utility[0])
                outputs = outputs._replace(utility=utility[None])
        utility, stay = (part[0].double().numpy() for part in (outputs.utility, outputs.stay))
        stated = self.largest(utility, stay, state.stated, ~starts)
        return stated, JumpMarkovMemory(net, stated)

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        """See `Decider.select_tracks`: all are kept."""
        return NotImplemented
