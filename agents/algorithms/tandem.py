"""MSPRT-TANDEM, which learns the true modes of segments."""

from collections.abc import Sequence
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.algorithms.reward import SegmentAlgorithm, Segments, SegmentSettings
from agents.learned.tandem_net import TandemDecider, WindowNet, log_ratios, windows_of


class Tandem(SegmentAlgorithm):
    """A training run of MSPRT-TANDEM."""

    name = "tandem"
    Settings = SegmentSettings
    decider = TandemDecider
    measure = "log_sum_exp"

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        """See `SegmentAlgorithm.labels`: the true modes (S,)."""
        return (found.modes,)

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the log-sum-exp loss of all rows, and the cross-entropies of all windows."""
        return tandem_loss(self.net, inputs, lengths, labels[0])


def tandem_loss(net: WindowNet, inputs: Tensor, lengths: Tensor, modes: Tensor) -> Tensor:
    """Return the loss of S sequences of vectors (n, ..., inputs), of lengths and hypotheses (S,).

    The log-sum-exp loss log(1 + sum over l of exp(-lambda_kl)) of Miyagawa & Ebihara 2021, for the
    ratios lambda_kl of the true hypothesis k to all others l, is the cross-entropy of the
    log-likelihoods.
    """
    ticks = torch.arange(len(inputs)) - (lengths.cumsum(0) - lengths).repeat_interleave(lengths) + 1
    each = modes.repeat_interleave(lengths)
    longer, shorter = (net(part) for part in windows_of(inputs, ticks, net.order))
    inside = ticks > 1
    windows = nn.functional.nll_loss(longer, each) + nn.functional.nll_loss(
        shorter[inside],
        each[inside],
    )
    return (
        nn.functional.cross_entropy(log_ratios(longer, shorter, ticks, net.order), each) + windows
    )
