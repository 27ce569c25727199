"""Training on the segments of `RewardRun`, but with their true modes: MSPRT-TANDEM, KalmanNet, the transformer."""

from collections.abc import Sequence
from typing import Any, ClassVar

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.kalman_net import KalmanBank, KalmanDecider, evidence, filter_inputs
from agents.learned.reward_decider import RewardDecider
from agents.learned.tandem_net import TandemDecider, WindowNet, log_ratios, windows_of
from agents.learned.transformer_net import TransformerDecider, raw_inputs
from agents.training.reward import RewardRun, Segments
from baselines.rules.decider import Observations
from hybrid_env.observation import Layout


class TrueModesRun(RewardRun):
    """Base class of the runs; `labels` of the loss are the true modes (S,) of the segments."""

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        """See `RewardRun.labels`."""
        return (found.modes,)


class TransformerRun(TrueModesRun):
    """A training run of `TransformerNet`."""

    decider: ClassVar[type[RewardDecider]] = TransformerDecider
    inputs = staticmethod(raw_inputs)

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the mean cross-entropy of the true modes over all rows."""
        return nn.functional.nll_loss(self.net(inputs, lengths), labels[0].repeat_interleave(lengths))


class TandemRun(TrueModesRun):
    """A training run of MSPRT-TANDEM."""

    decider: ClassVar[type[RewardDecider]] = TandemDecider
    measure: ClassVar[str] = "log_sum_exp"

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the log-sum-exp loss of all rows, and the cross-entropies of all windows."""
        return tandem_loss(self.net, inputs, lengths, labels[0])


def tandem_loss(net: WindowNet, inputs: Tensor, lengths: Tensor, modes: Tensor) -> Tensor:
    """Return the loss of the sequences of vectors of S hypotheses, Miyagawa & Ebihara 2021.

    The log-sum-exp loss log(1 + sum over l of exp(-lambda_kl)), for the ratios lambda_kl of the true hypothesis k to
    all others l, is the cross-entropy of the log-likelihoods.

    Args:
        net: the network.
        inputs: (n, ..., inputs) of all sequences, one after the other.
        lengths, modes: (S,) of the sequences, and their hypotheses.
    """
    ticks = torch.arange(len(inputs)) - (lengths.cumsum(0) - lengths).repeat_interleave(lengths) + 1
    each = modes.repeat_interleave(lengths)
    longer, shorter = (net(part) for part in windows_of(inputs, ticks, net.order))
    inside = ticks > 1
    windows = nn.functional.nll_loss(longer, each) + nn.functional.nll_loss(shorter[inside], each[inside])
    return nn.functional.cross_entropy(log_ratios(longer, shorter, ticks, net.order), each) + windows


class KalmanRun(TrueModesRun):
    """A training run of KalmanNet, without the true states."""

    decider: ClassVar[type[RewardDecider]] = KalmanDecider
    measure: ClassVar[str] = "negative_log_likelihood"

    @staticmethod
    def inputs(rows: Observations, tau: float) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the inputs of the filters (n, M + 1, 9), and the ticks (n,)."""
        return filter_inputs(rows, tau), Layout.of_rows(rows).read(rows, "ticks")

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the negative log-likelihood of a measurement by the true filter, and the cross-entropy of a row."""
        found, inside = segment_logs(self.net, inputs, lengths)
        true = labels[0].expand(inside.shape)[..., None]
        likelihood = found.gather(-1, true)[..., 0][inside].mean()
        return nn.functional.cross_entropy(found.cumsum(0)[inside], true[..., 0][inside]) - likelihood


def segment_logs(net: KalmanBank, inputs: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
    """Return the log-likelihoods of every measurement (T, S, M), and which are inside their segments (T, S).

    The inputs (n, M + 1, 9) are those of all segments of `lengths` (S,) rows, one after the other.
    """
    ticks = torch.arange(int(lengths.max()))[:, None]
    rows = torch.minimum(ticks, lengths - 1) + lengths.cumsum(0) - lengths
    padded = inputs[rows].flatten(1, 2)
    filters, found = net.begin(padded[0]), []
    for each in padded:
        filters, logs = net.advance(filters, each)
        found.append(logs)
    return evidence(torch.stack(found).unflatten(1, (len(lengths), -1))), ticks < lengths
