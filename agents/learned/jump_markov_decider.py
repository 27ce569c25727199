"""The jump-Markov net as a decider."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
import torch

from agents.learned.jump_markov_net import JumpMarkovNet, JumpMarkovState, track_inputs
from agents.learned.statement_decider import UtilityDecider
from baselines.rules.decider import Actions, SeveralThresholds
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

    @classmethod
    def together(cls, deciders: Sequence[Self]) -> "JumpMarkovDeciders":
        """Return deciders that differ in their margins only; their network is computed once."""
        return JumpMarkovDeciders(deciders)

    @torch.no_grad()
    def utilities(
        self, observation: FloatArray, state: JumpMarkovState | None, starts: BoolArray
    ) -> tuple[FloatArray, FloatArray, JumpMarkovState]:
        """Return the utilities (N, M) of the modes, those (N,) of keeping the statement, and the state of the network.

        Args:
            observation: (N, 16 + M) from `observe`.
            state: of the last tick; None begins anew.
            starts: (N,) True where an episode begins.
        """
        M = self.hypotheses
        if observation.ndim != 2 or observation.shape[1] < OBSERVED + M:
            raise reject("observation shape", observation.shape, f"(N, {OBSERVED + M})")
        inputs = torch.from_numpy(track_inputs(self.world, observation))
        logs = torch.from_numpy(observation[:, OBSERVED : OBSERVED + M]).float()
        if state is None or starts.any():
            outputs, net = self.net.begin(inputs, logs)
        if state is not None:
            now, after = self.net.step(inputs, state)
            if starts.any():
                anew = torch.from_numpy(starts)
                after = after.replaced(anew, net)
                now = now._replace(utility=torch.where(anew[:, None], outputs.utility, now.utility))
            outputs, net = now, after
        utility, stay = outputs.utility[0].double().numpy(), outputs.stay[0].double().numpy()
        return utility, stay, net

    def decide(
        self, observation: FloatArray, state: JumpMarkovMemory | None, episode_start: BoolArray | None
    ) -> tuple[Actions, JumpMarkovMemory]:
        """See `MeasurementDecider.decide`."""
        starts = starts_of(observation, state, episode_start)
        utility, stay, net = self.utilities(observation, None if state is None else state.net, starts)
        last = np.zeros(len(observation), np.int64) if state is None else state.stated
        stated = self.largest(utility, stay, last, ~starts)
        return stated, JumpMarkovMemory(net, stated)

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        """See `Decider.select_tracks`: all are kept."""
        return NotImplemented


class JumpMarkovDeciders(SeveralThresholds):
    """Deciders that differ in their margins only: what their network computes does not depend on statements.

    Args:
        deciders: with the same network.
    """

    observes = "tracks"

    def __init__(self, deciders: Sequence[JumpMarkovDecider]):
        self.deciders = deciders
        self.chosen = []

    def observe(self, tracks: Any) -> FloatArray:
        """See `MeasurementDecider.observe`."""
        return self.deciders[0].observe(tracks)

    def decide(self, observation: FloatArray, state: Any, episode_start: Any) -> tuple[Actions, Any]:
        """See `MeasurementDecider.decide`. The state is that of the network."""
        starts = starts_of(observation, state, episode_start)
        utility, stay, state = self.deciders[0].utilities(observation, state, starts)
        last = self.chosen or [np.zeros(len(observation), np.int64)] * len(self.deciders)
        pairs = zip(self.deciders, last, strict=True)
        self.chosen = [one.largest(utility.copy(), stay, stated, ~starts) for one, stated in pairs]
        return self.chosen[0], state


def starts_of(observation: FloatArray, state: Any, episode_start: BoolArray | None) -> BoolArray:
    """Return where episodes begin (N,): everywhere without a state, nowhere else unless it is said."""
    if state is None:
        return np.ones(len(observation), np.bool_)
    return np.zeros(len(observation), np.bool_) if episode_start is None else episode_start
