"""KalmanNet, which learns the true modes of segments, without the true states."""

from collections.abc import Sequence
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.algorithms.reward import SegmentAlgorithm, Segments, SegmentSettings
from agents.learned.kalman_net import KalmanBank, KalmanDecider, evidence, filter_inputs
from baselines.rules.decider import Observations
from hybrid_env.observation import Layout


class Kalman(SegmentAlgorithm):
    """A training run of KalmanNet, without the true states."""

    name = "kalman"
    Settings = SegmentSettings
    decider = KalmanDecider
    measure = "negative_log_likelihood"

    @staticmethod
    def inputs(rows: Observations, tau: float) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the inputs of the filters (n, M + 1, 9), and the ticks (n,)."""
        return filter_inputs(rows, tau), Layout.of_rows(rows).read(rows, "ticks")

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        """See `SegmentAlgorithm.labels`: the true modes (S,)."""
        return (found.modes,)

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the negative log-likelihood of a measurement by the true filter, and the
        cross-entropy of a row.
        """
        found, inside = segment_logs(self.net, inputs, lengths)
        true = labels[0].expand(inside.shape)[..., None]
        likelihood = found.gather(-1, true)[..., 0][inside].mean()
        return (
            nn.functional.cross_entropy(found.cumsum(0)[inside], true[..., 0][inside]) - likelihood
        )


def segment_logs(net: KalmanBank, inputs: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
    """Return the log-likelihoods of every measurement (T, S, M), and which are inside their
    segments (T, S).

    The inputs (n, M + 1, 9) are those of all segments of `lengths` (S,) rows, one after the other.
    """
    ticks = torch.arange(int(lengths.max()))[:, None]
    rows = torch.minimum(ticks, lengths - 1) + lengths.cumsum(0) - lengths
    padded = inputs[rows].flatten(1, 2)
    filters = net.begin(padded[0])
    found = []
    for each in padded:
        filters, logs = net.advance(filters, each)
        found.append(logs)
    return evidence(torch.stack(found).unflatten(1, (len(lengths), -1))), ticks < lengths
