"""MSPRT-TANDEM as a decider: the matrix SPRT on learned log-likelihood ratios."""

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from agents.learned.reward_decider import RewardDecider
from agents.learned.reward_net import reward_inputs
from agents.learned.tandem_net import TandemNet, windows_of
from baselines.rules.decider import Observations
from hybrid_env.checks import BoolArray, FloatArray


class TandemState(NamedTuple):
    """State of N tracks.

    Attributes:
        rows: (N, order + 1, M - 1, inputs) last rows, the present one last.
        ratios: (N, M) log-likelihoods of the segment, up to a common term.
    """

    rows: Tensor
    ratios: Tensor


class TandemDecider(RewardDecider):
    """Declares the likeliest hypothesis once its posterior by the learned ratios, with equal priors, is 1 - alpha."""

    default = 0.02
    network = TandemNet
    label = "learned likelihood ratios"

    @torch.no_grad()
    def posterior(self, observation: Observations, state: Any, episode_start: Any) -> tuple[FloatArray, TandemState]:
        """See `PosteriorDecider.posterior`. The state is a `TandemState`."""
        rows = self.checked(observation)
        inputs, _ = (torch.from_numpy(part) for part in reward_inputs(rows, self.world.tau))
        ticks = torch.from_numpy(self.layout.read(rows, "ticks").round().astype(np.int64))
        order = self.net.order
        before = inputs[:, None].expand(-1, order + 1, -1, -1) if state is None else state.rows
        last = torch.cat([before[:, 1:], inputs[:, None]], 1)
        # every track as a segment of N + 1 rows, of which those before the switch are left out
        lags = torch.arange(-order, 1).repeat(len(rows)) + ticks.repeat_interleave(order + 1)
        longer, shorter = (
            self.net(part[order :: order + 1]) for part in windows_of(last.flatten(0, 1), lags.clamp(min=1), order)
        )
        beyond = (ticks > order + 1)[:, None]
        ratios = longer if state is None else torch.where(beyond, state.ratios + longer - shorter, longer)
        return torch.softmax(ratios.double(), -1).numpy(), TandemState(last, ratios)

    def select_tracks(self, state: Any, tracks: BoolArray) -> TandemState | None:
        """See `RewardDecider.select_tracks`."""
        return None if state is None else TandemState(*(part[torch.from_numpy(tracks)] for part in state))
