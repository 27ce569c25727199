"""When to stop, learned by PPO from what a sequence agent believes.

To wait pays twice: this segment's declaration is surer, and the next segment begins at a better anchor. A
threshold on the doubt weighs the first alone. A policy that is rewarded over the whole episode weighs both.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import Tensor

from agents.learned.policy import PolicyDecider, beliefs_of
from agents.learned.sequence import SINGLES, SequenceNet, doubts_and_best
from baselines.deciders.decider import Actions, Observations

LEAST = 1e-8  # smaller doubts look alike
DOUBT_SCALE = 0.25  # of their logarithms
LARGEST = 5.0  # single quantities of a row are clipped here


class Beliefs:
    """What a sequence agent believes of N tracks, tick by tick, in one row of numbers each.

    The row has the logarithms of two doubts, of the type and of the radius within it, whether the best
    hypothesis is straight, the single quantities of the observation, and the memory of the best hypothesis.

    Args:
        net: trained; it is not trained further.
        by_type: the best hypothesis is the likeliest of the likeliest type, not the likeliest of all.
    """

    def __init__(self, net: SequenceNet, by_type: bool):
        self.net, self.by_type = net, by_type
        self.width = 3 + len(SINGLES) + net.hidden

    def read(
        self, observation: Observations, memory: Tensor | None
    ) -> tuple[NDArray[np.float32], NDArray[np.int64], Tensor]:
        """Rows (N, width), the best hypothesis of each track (N,), and the memory (N, M, hidden)."""
        posterior, memory = self.net.believe(observation, memory)
        type_doubt, radius_doubt, best = doubts_and_best(posterior, self.by_type)
        doubts = np.stack([type_doubt, radius_doubt / (1.0 - type_doubt)])
        beliefs = np.concatenate(
            [
                DOUBT_SCALE * np.log(np.maximum(doubts, LEAST)).T,
                best[:, None] == 0,
                np.clip(observation[:, -len(SINGLES) :], -LARGEST, LARGEST),
                memory[torch.arange(len(best)), torch.from_numpy(best)].numpy(),
            ],
            axis=1,
        )
        return beliefs.astype(np.float32), best, memory


class StoppingDecider(PolicyDecider):
    """Declares what a sequence agent finds likeliest, once a policy's log-odds of stopping pass a threshold.

    Args:
        policy: actor with 2 actions, and the agent's network under the name `beliefs`.
        by_type: only the type is rewarded.
        threshold: on ln p(stop) - ln p(wait).
    """

    def __init__(self, policy: ActorCriticPolicy, by_type: bool, threshold: float = 0.0):
        super().__init__(policy, threshold)
        net = beliefs_of(policy)
        assert net is not None
        self.beliefs = Beliefs(net, by_type)

    def with_threshold(self, threshold: float) -> "StoppingDecider":
        """The same policy at another threshold."""
        return StoppingDecider(self.policy, self.beliefs.by_type, threshold)

    @property
    def hypotheses(self) -> None:
        """It reads any bank, as the agent does."""
        return None

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Tensor]:
        """See `Decider.predict`; the state is the memory of every hypothesis, (N, M, hidden)."""
        rows, best, state = self.beliefs.read(observation, state)
        declared, _ = self.choose(self.logits(rows)[0], deterministic)
        return np.where(declared, best + 1, 0), state

    def keep(self, state: Tensor, tracks: NDArray[np.bool_]) -> Tensor:
        """The state of some of its tracks, (N,) bool: `evaluate` leaves out those that have finished."""
        return state[torch.from_numpy(tracks)]
