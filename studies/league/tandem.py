"""MSPRT-TANDEM: the matrix SPRT on log-likelihood ratios that a network learns from short
windows of rows.

Miyagawa & Ebihara 2021, "The power of log-sum-exp: sequential density ratio matrix estimation for
speed-accuracy optimization", ICML. A network estimates the posterior of the hypotheses given the
last rows alone. The ratios of a whole segment are sums of those of windows of N + 1 rows, less
those of the N rows that two windows share (the TANDEM formula of order N), so that no memory is
learned. They are exact if the rows are a Markov chain of order N.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.statement_net import GAIN, zero_layer
from baselines.rules.decider import Observations
from studies.league.reward import (
    INPUTS,
    RewardDecider,
    SegmentAlgorithm,
    Segments,
    SegmentSettings,
    hidden_layers,
    reward_inputs,
    with_straight,
)

ORDER = 5


class WindowNet(nn.Module):
    """Posterior of K = `outputs` hypotheses from a window of up to N + 1 vectors of any kind, N
    = `order`.
    """

    def __init__(self, inputs: int, outputs: int, hidden: int, order: int = ORDER):
        super().__init__()
        self.order = order
        self.layers = hidden_layers((order + 1) * (inputs + 1), hidden)
        self.output = zero_layer(hidden, outputs)

    def outputs(self, windows: Tensor) -> Tensor:
        """Return the outputs (..., K) of windows (..., (N + 1) (inputs + 1)), see `windows_of`."""
        return GAIN * self.output(self.layers(windows))

    def forward(self, windows: Tensor) -> Tensor:
        """Return logarithms of the posterior (..., K)."""
        return torch.log_softmax(self.outputs(windows), -1)


class TandemNet(WindowNet):
    """The network for the rows of an environment with any number of turns, which it sees one by
    one.
    """

    def __init__(self, hidden: int):
        super().__init__(INPUTS, 2, hidden)

    def forward(self, windows: Tensor) -> Tensor:
        """Return logarithms of the posterior (n, M) of windows of each turn, (n, M - 1, (N + 1)
        (inputs + 1)).
        """
        return torch.log_softmax(with_straight(self.outputs(windows)), -1)


def windows_of(inputs: Tensor, ticks: Tensor, order: int) -> tuple[Tensor, Tensor]:
    """Return the windows of N + 1 rows that end at each row, and the same without the row
    itself, N = `order`.

    The inputs are (n, ..., inputs) of the rows of all segments, one after the other, and the ticks
    (n,) count from 1 in each. Windows are (n, ..., (N + 1) (inputs + 1)): the last number of a row
    is 1 where there is one, else all are 0.
    """
    marked = torch.cat([inputs, torch.ones_like(inputs[..., :1])], -1)
    rows = torch.arange(len(ticks))
    shape = (-1,) + (1,) * (inputs.ndim - 1)
    parts = [
        marked[(rows - lag).clamp(min=0)] * (ticks > lag).view(shape)
        for lag in range(order, -1, -1)
    ]
    return torch.cat(parts, -1), torch.cat([*parts[:-1], torch.zeros_like(marked)], -1)


def log_ratios(longer: Tensor, shorter: Tensor, ticks: Tensor, order: int) -> Tensor:
    """Return the log-likelihoods of each hypothesis up to a common term, (n, K): the TANDEM
    formula.

    `longer` and `shorter` (n, K) are logarithms of the posteriors of `windows_of`, at the same
    ticks (n,).
    """
    steps = torch.where((ticks > order + 1)[:, None], longer - shorter, 0.0)
    sums = steps.cumsum(0)
    begins = torch.arange(len(ticks)) - ticks + 1
    first = torch.arange(len(ticks)) - (ticks - order - 1).clamp(min=0)
    return sums - (sums - steps)[begins] + longer[first]


class TandemState(NamedTuple):
    """State of N tracks."""

    # (N, order + 1, M - 1, inputs) last rows, the present one last.
    rows: Tensor
    # (N, M) log-likelihoods of the segment, up to a common term.
    ratios: Tensor


class TandemDecider(RewardDecider):
    """Declares the likeliest hypothesis once its posterior by the learned ratios, with equal
    priors, is 1 - alpha.
    """

    default = 0.02
    network = TandemNet
    label = "learned likelihood ratios"

    def advance(
        self,
        rows: Observations,
        ticks: Tensor,
        state: TandemState | None,
    ) -> tuple[Tensor, TandemState]:
        inputs, order = torch.from_numpy(reward_inputs(rows, self.world.tau)[0]), self.net.order
        before = inputs[:, None].expand(-1, order + 1, -1, -1) if state is None else state.rows
        last = torch.cat([before[:, 1:], inputs[:, None]], 1)
        # Every track as a segment of N + 1 rows, of which those before the switch are left out.
        lags = torch.arange(-order, 1).repeat(len(rows)) + ticks.repeat_interleave(order + 1)
        windows = windows_of(last.flatten(0, 1), lags.clamp(min=1), order)
        longer, shorter = (self.net(part[order :: order + 1]) for part in windows)
        beyond = (ticks > order + 1)[:, None]
        ratios = (
            longer
            if state is None
            else torch.where(beyond, state.ratios + longer - shorter, longer)
        )
        return torch.softmax(ratios.double(), -1), TandemState(last, ratios)


class Tandem(SegmentAlgorithm):
    """A training run of MSPRT-TANDEM."""

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
