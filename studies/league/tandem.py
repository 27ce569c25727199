"""MSPRT-TANDEM: the matrix SPRT on log-likelihood ratios that a network learns from short
windows of rows.

Miyagawa & Ebihara 2021, "The power of log-sum-exp: sequential density ratio matrix estimation for
speed-accuracy optimization", ICML. A network estimates the posterior of the hypotheses given the
last rows alone. The ratios of a whole segment are sums of those of windows of N + 1 rows, less
those of the N rows that two windows share (the TANDEM formula of order N), so that no memory is
learned. They are exact if the rows are a Markov chain of order N.
"""

import torch
from torch import Tensor, nn

from studies.league.segments import (
    INPUTS,
    Rows,
    SegmentAlgorithm,
    SegmentDecider,
    Segments,
    places,
    row_inputs,
    turn_layers,
    with_straight,
)


class TandemNet(nn.Module):
    """Posterior of the hypotheses from a window of up to N + 1 rows, N = `order`."""

    def __init__(self, hidden: int, order: int = 5):
        super().__init__()
        self.order = order
        self.layers = turn_layers((order + 1) * (INPUTS + 1), hidden)

    def forward(self, windows: Tensor) -> Tensor:
        """Return logarithms of the posterior (n, M) of windows of each turn, (n, M - 1, (N + 1)
        (inputs + 1)), see `windows_of`.
        """
        return torch.log_softmax(with_straight(self.layers(windows)), -1)


def windows_of(inputs: Tensor, ticks: Tensor, order: int) -> tuple[Tensor, Tensor]:
    """Return the windows of N + 1 rows that end at each row, and the same without the row
    itself, N = `order`.

    The inputs are (n, M - 1, inputs) of the rows of all segments, one after the other, and the
    ticks (n,) count from 1 in each. Windows are (n, M - 1, (N + 1) (inputs + 1)): the last number
    of a row is 1 where there is one, else all are 0.
    """
    marked = torch.cat([inputs, torch.ones_like(inputs[..., :1])], -1)
    rows = torch.arange(len(ticks))
    parts = [
        marked[(rows - lag).clamp(min=0)] * (ticks > lag)[:, None, None]
        for lag in range(order, -1, -1)
    ]
    return torch.cat(parts, -1), torch.cat([*parts[:-1], torch.zeros_like(marked)], -1)


def log_ratios(longer: Tensor, shorter: Tensor, ticks: Tensor, order: int) -> Tensor:
    """Return the log-likelihoods of each hypothesis up to a common term, (n, M): the TANDEM
    formula.

    `longer` and `shorter` (n, M) are logarithms of the posteriors of `windows_of`, at the same
    ticks (n,).
    """
    steps = torch.where((ticks > order + 1)[:, None], longer - shorter, 0.0)
    sums = steps.cumsum(0)
    rows = torch.arange(len(ticks))
    first = rows - (ticks - order - 1).clamp(min=0)
    return sums - (sums - steps)[rows - ticks + 1] + longer[first]


class TandemDecider(SegmentDecider):
    """Declares once the posterior by the learned ratios, with equal priors, is 1 - alpha.

    The state are the last rows (N, order + 1, M - 1, inputs), the present one last, and the
    log-likelihoods of the segment up to a common term, (N, M).
    """

    network = TandemNet

    def advance(
        self, rows: Rows, ticks: Tensor, state: tuple[Tensor, Tensor] | None
    ) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        inputs, order = torch.from_numpy(row_inputs(rows)[0]), self.net.order
        now = inputs[:, None]
        before = now.expand(-1, order + 1, -1, -1) if state is None else state[0]
        last = torch.cat([before[:, 1:], now], 1)
        # Every track as a segment of N + 1 rows, of which those before the switch are left out.
        lags = torch.arange(-order, 1).repeat(len(rows)) + ticks.repeat_interleave(order + 1)
        windows = windows_of(last.flatten(0, 1), lags.clamp(min=1), order)
        longer, shorter = (self.net(part[order :: order + 1]) for part in windows)
        ratios = longer
        if state is not None:
            inside = (ticks > order + 1)[:, None]
            ratios = torch.where(inside, state[1] + longer - shorter, longer)
        return torch.softmax(ratios.double(), -1), (last, ratios)


class Tandem(SegmentAlgorithm):
    """A training run of MSPRT-TANDEM."""

    decider = TandemDecider

    def loss(self, inputs: list[Tensor], segments: Segments) -> Tensor:
        """Return the log-sum-exp loss of all rows, and the cross-entropies of all windows.

        The log-sum-exp loss log(1 + sum over l of exp(-lambda_kl)) of Miyagawa & Ebihara 2021, for
        the ratios lambda_kl of the true hypothesis k to all others l, is the cross-entropy of the
        log-likelihoods.
        """
        segment, place = places(segments.lengths)
        true, order = segments.modes[segment], self.net.order
        longer, shorter = map(self.net, windows_of(inputs[0], place + 1, order))
        inside = place > 0
        windows = nn.functional.nll_loss(longer, true)
        windows = windows + nn.functional.nll_loss(shorter[inside], true[inside])
        ratios = log_ratios(longer, shorter, place + 1, order)
        return nn.functional.cross_entropy(ratios, true) + windows
