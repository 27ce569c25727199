"""KalmanNet as a decider: the matrix SPRT on the likelihoods of filters with a learned gain."""

from typing import Any, NamedTuple

import torch
from torch import Tensor

from agents.learned.kalman_net import KalmanBank, KalmanState, evidence, filter_inputs
from agents.learned.reward_decider import RewardDecider
from baselines.rules.decider import Observations
from hybrid_env.checks import BoolArray, FloatArray


class KalmanMemory(NamedTuple):
    """State of N tracks.

    Attributes:
        filters: of N (M + 1) filters.
        logs: (N, M + 1) their log-likelihoods since the anchor.
    """

    filters: KalmanState
    logs: Tensor


class KalmanDecider(RewardDecider):
    """Declares the likeliest hypothesis once its posterior by the learned filters, with equal priors, is 1 - alpha."""

    default = 0.02
    network = KalmanBank
    label = "learned Kalman gain"

    @torch.no_grad()
    def posterior(self, observation: Observations, state: Any, episode_start: Any) -> tuple[FloatArray, KalmanMemory]:
        """See `PosteriorDecider.posterior`. The state is a `KalmanMemory`."""
        rows = self.checked(observation)
        inputs = torch.from_numpy(filter_inputs(rows, self.world.tau)).flatten(0, 1)
        filters, before = self.net.begin(inputs), torch.zeros(len(rows), self.layout.hypotheses + 1)
        if state is not None:
            goes_on = torch.from_numpy(self.layout.read(rows, "ticks") > 1.5)[:, None]
            each = goes_on.repeat_interleave(before.shape[1], 0)
            pairs = zip(state.filters, filters, strict=True)
            filters = KalmanState(*(torch.where(each, old, new) for old, new in pairs))
            before = torch.where(goes_on, state.logs, before)
        filters, logs = self.net.advance(filters, inputs)
        logs = before + logs.view_as(before)
        return torch.softmax(evidence(logs).double(), -1).numpy(), KalmanMemory(filters, logs)

    def select_tracks(self, state: Any, tracks: BoolArray) -> KalmanMemory | None:
        """See `RewardDecider.select_tracks`."""
        if state is None:
            return None
        kept = torch.from_numpy(tracks)
        each = kept.repeat_interleave(state.logs.shape[1])
        return KalmanMemory(KalmanState(*(part[each] for part in state.filters)), state.logs[kept])
