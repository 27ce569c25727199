"""The network of MSPRT-TANDEM: log-likelihood ratios of the hypotheses from short windows of rows.

Miyagawa & Ebihara 2021, "The power of log-sum-exp: sequential density ratio matrix estimation for
speed-accuracy optimization", ICML. A network estimates the posterior of the hypotheses given the last rows alone.
The ratios of a whole segment are sums of those of windows of N + 1 rows, less those of the N rows that two windows
share (the TANDEM formula of order N), so that no memory is learned. They are exact if the rows are a Markov chain
of order N.
"""

import torch
from torch import Tensor, nn

from agents.learned.reward_net import INPUTS
from agents.learned.statement_net import GAIN

ORDER = 5


class WindowNet(nn.Module):
    """Logarithms of the posterior of K hypotheses from a window of vectors of any kind.

    Args:
        inputs: length of a vector.
        outputs: K.
        hidden: units of every layer.
        order: N; a window has at most N + 1 vectors.
    """

    def __init__(self, inputs: int, outputs: int, hidden: int, order: int = ORDER):
        super().__init__()
        self.order = order
        self.layers = nn.Sequential(
            nn.Linear((order + 1) * (inputs + 1), hidden), nn.SiLU(), nn.Linear(hidden, hidden), nn.SiLU()
        )
        self.output = nn.Linear(hidden, outputs)
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def logits(self, windows: Tensor) -> Tensor:
        """Return unnormalized logarithms (..., K) of windows (..., (N + 1) (inputs + 1)), see `windows_of`."""
        logits: Tensor = GAIN * self.output(self.layers(windows))
        return logits

    def forward(self, windows: Tensor) -> Tensor:
        """Return logarithms of the posterior (..., K)."""
        return torch.log_softmax(self.logits(windows), -1)


class TandemNet(WindowNet):
    """The network for the rows of an environment with any number of turns, which it sees one by one.

    Args:
        hidden: units of every layer.
    """

    def __init__(self, hidden: int):
        super().__init__(INPUTS, 2, hidden)

    def forward(self, windows: Tensor) -> Tensor:
        """Return logarithms of the posterior (n, M) of windows of each turn, (n, M - 1, (N + 1) (inputs + 1))."""
        outputs = self.logits(windows)
        return torch.log_softmax(torch.cat([outputs[..., 1].mean(-1, keepdim=True), outputs[..., 0]], -1), -1)


def windows_of(inputs: Tensor, ticks: Tensor, order: int) -> tuple[Tensor, Tensor]:
    """Return the windows of N + 1 rows that end at each row, and the same without the row itself.

    Args:
        inputs: (n, ..., inputs) of the rows of all segments, one after the other.
        ticks: (n,) of each row since the beginning of its segment, from 1.
        order: N.

    Returns:
        Two arrays (n, ..., (N + 1) (inputs + 1)). Rows before the segment are zeros; the last number of each row is 1
        where there is one.
    """
    marked = torch.cat([inputs, torch.ones_like(inputs[..., :1])], -1)
    rows = torch.arange(len(ticks))
    shape = (-1,) + (1,) * (inputs.ndim - 1)
    parts = []
    for lag in range(order, -1, -1):
        inside = (ticks > lag).view(shape)
        parts.append(marked[(rows - lag).clamp(min=0)] * inside)
    return torch.cat(parts, -1), torch.cat([*parts[:-1], torch.zeros_like(marked)], -1)


def log_ratios(longer: Tensor, shorter: Tensor, ticks: Tensor, order: int) -> Tensor:
    """Return the log-likelihoods of each hypothesis up to a common term, (n, K): the TANDEM formula.

    Args:
        longer, shorter: (n, K) posteriors of the windows of `windows_of`, logarithms.
        ticks: (n,) of each row.
        order: N.
    """
    steps = torch.where((ticks > order + 1)[:, None], longer - shorter, 0.0)
    sums = steps.cumsum(0)
    begins = torch.arange(len(ticks)) - ticks + 1
    first = torch.arange(len(ticks)) - (ticks - order - 1).clamp(min=0)
    return sums - (sums - steps)[begins] + longer[first]


def lsel(ratios: Tensor, modes: Tensor) -> Tensor:
    """Return the log-sum-exp loss of log-likelihoods (n, K) with true hypotheses (n,).

    It is log(1 + sum over l of exp(-lambda_kl)), for the ratios lambda_kl of the true hypothesis k to all others l.
    """
    return nn.functional.cross_entropy(ratios, modes)
