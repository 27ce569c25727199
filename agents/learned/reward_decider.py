"""The network that has learned from rewards alone, as a decider."""

from typing import Any

import numpy as np
import torch
from torch import Tensor

from agents.learned.posterior_decider import PosteriorDecider
from agents.learned.reward_net import RewardNet, reward_inputs
from baselines.rules.decider import Observations
from baselines.rules.msprt import posterior_of
from hybrid_env.checks import BoolArray, FloatArray, IntArray, reject


class RewardDecider(PosteriorDecider):
    """Declares the likeliest hypothesis once the probability of a negative reward is at most alpha.

    The state is the memory of the network (N, M - 1, hidden), which begins anew at every switch.
    """

    default = 0.03
    network = RewardNet
    label = "learned from rewards"

    @torch.no_grad()
    def posterior(self, observation: Observations, state: Any, episode_start: Any) -> tuple[FloatArray, Tensor]:
        """See `PosteriorDecider.posterior`."""
        rows = np.asarray(observation, np.float32)
        if rows.ndim != 2 or rows.shape[1] != self.layout.width:
            raise reject("observation shape", rows.shape, f"(N, {self.layout.width})")
        inputs, logs = (torch.from_numpy(part) for part in reward_inputs(rows, self.world.tau))
        memory = self.net.features(inputs)
        if state is not None:
            goes_on = torch.from_numpy(self.layout.read(rows, "ticks") > 1.5)
            memory = memory + torch.where(goes_on[:, None, None], state, 0.0)
        return self.net(inputs, memory, logs).double().exp().numpy(), memory

    def errors(self, observation: Observations, posterior: FloatArray, state: Any) -> tuple[FloatArray, IntArray]:
        """See `PosteriorDecider.errors`."""
        values = posterior_of(posterior, self.by_type)
        largest = values.max(-1, keepdims=True)
        return 1.0 - largest[:, 0], np.where(values == largest, posterior, -1.0).argmax(-1)

    def select_tracks(self, state: Tensor | None, tracks: BoolArray) -> Tensor | None:
        """Return the memory of the tracks selected by a mask (N,); `evaluate` drops finished tracks."""
        return None if state is None else state[torch.from_numpy(tracks)]
