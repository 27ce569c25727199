"""Training of KalmanNet: the likelihood of the true mode over whole segments, without the true states."""

from collections.abc import Sequence
from typing import Any, ClassVar

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.kalman_decider import KalmanDecider
from agents.learned.kalman_net import KalmanBank, evidence, filter_inputs
from agents.learned.reward_decider import RewardDecider
from agents.training.reward import RewardRun, Segments
from baselines.rules.decider import Observations
from hybrid_env.observation import Layout


class KalmanRun(RewardRun):
    """A training run of KalmanNet on the segments of `RewardRun`, but with their true modes."""

    decider: ClassVar[type[RewardDecider]] = KalmanDecider
    measure: ClassVar[str] = "negative_log_likelihood"

    @staticmethod
    def inputs(rows: Observations, tau: float) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the inputs of the filters (n, M + 1, 9), and the ticks (n,)."""
        return filter_inputs(rows, tau), Layout.of_rows(rows).read(rows, "ticks")

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        """See `RewardRun.labels`."""
        return (found.modes,)

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the negative log-likelihood of a measurement by the true filter, and the cross-entropy of a row.

        Args:
            inputs, logs, lengths: see `RewardRun.loss` and `inputs`.
            labels: (S,) true modes.
        """
        (modes,) = labels
        found, inside = segment_logs(self.net, inputs, lengths)
        true = modes.expand(inside.shape)[..., None]
        likelihood = found.gather(-1, true)[..., 0][inside].mean()
        entropy = nn.functional.cross_entropy(found.cumsum(0)[inside], true[..., 0][inside])
        return entropy - likelihood


def segment_logs(net: KalmanBank, inputs: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
    """Return the log-likelihoods of every measurement (T, S, M), and which are inside their segments (T, S).

    Args:
        net: the filters.
        inputs: (n, M + 1, 9) of all S segments, one after the other.
        lengths: (S,) rows of the segments.
    """
    ticks = torch.arange(int(lengths.max()))[:, None]
    rows = torch.minimum(ticks, lengths - 1) + lengths.cumsum(0) - lengths
    padded = inputs[rows].flatten(1, 2)
    filters, found = net.begin(padded[0]), []
    for each in padded:
        filters, logs = net.advance(filters, each)
        found.append(logs)
    return evidence(torch.stack(found).unflatten(1, (len(lengths), -1))), ticks < lengths
