"""Training of MSPRT-TANDEM: log-likelihood ratios from the true modes of whole segments."""

from collections.abc import Sequence
from typing import Any, ClassVar

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.reward_decider import RewardDecider
from agents.learned.tandem_decider import TandemDecider
from agents.learned.tandem_net import WindowNet, log_ratios, lsel, windows_of
from agents.training.reward import RewardRun, Segments


class TandemRun(RewardRun):
    """A training run of MSPRT-TANDEM on the segments of `RewardRun`, but with their true modes."""

    decider: ClassVar[type[RewardDecider]] = TandemDecider
    measure: ClassVar[str] = "log_sum_exp"

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        """See `RewardRun.labels`."""
        return (found.modes,)

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the log-sum-exp loss of all rows, and the cross-entropies of all windows.

        Args:
            inputs, logs, lengths: see `RewardRun.loss`.
            labels: (S,) true modes.
        """
        (modes,) = labels
        return tandem_loss(self.net, inputs, lengths, modes)


def tandem_loss(net: WindowNet, inputs: Tensor, lengths: Tensor, modes: Tensor) -> Tensor:
    """Return the loss of the sequences of vectors of S hypotheses, Miyagawa & Ebihara 2021.

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
    return lsel(log_ratios(longer, shorter, ticks, net.order), each) + windows
