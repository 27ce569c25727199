"""The network that has learned from rewards alone, as a decider."""

from typing import Any, ClassVar

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
    network: ClassVar[Any] = RewardNet
    label = "learned from rewards"

    @torch.no_grad()
    def posterior(self, observation: Observations, state: Any, episode_start: Any) -> tuple[FloatArray, Any]:
        """See `PosteriorDecider.posterior`."""
        rows, ticks = self.read(observation)
        inputs, logs = map(torch.from_numpy, reward_inputs(rows, self.world.tau))
        memory = self.net.features(inputs)
        if state is not None:
            memory = memory + torch.where((ticks > 1)[:, None, None], state, 0.0)
        return self.net(inputs, memory, logs).double().exp().numpy(), memory

    def read(self, observation: Observations) -> tuple[Observations, Tensor]:
        """Return the rows (N, width), checked, and the ticks (N,) since the switch, from 1."""
        rows = np.asarray(observation, np.float32)
        if rows.ndim != 2 or rows.shape[1] != self.layout.width:
            raise reject("observation shape", rows.shape, f"(N, {self.layout.width})")
        ticks = self.layout.read(rows, "ticks").round().astype(np.int64)
        return rows, torch.from_numpy(ticks).clamp(min=1)

    def errors(self, observation: Observations, posterior: FloatArray, state: Any) -> tuple[FloatArray, IntArray]:
        """See `PosteriorDecider.errors`."""
        values = posterior_of(posterior, self.by_type)
        largest = values.max(-1, keepdims=True)
        return 1.0 - largest[:, 0], np.where(values == largest, posterior, -1.0).argmax(-1)

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        """See `Decider.select_tracks`; the state is one tensor (N, ...) or a named tuple of them."""
        if state is None:
            return None
        kept = torch.from_numpy(tracks)
        return state[kept] if isinstance(state, Tensor) else type(state)(*(part[kept] for part in state))
