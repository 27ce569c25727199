"""An agent that learns from the rewards of its declarations alone.

Of the environment the agent knows what its documentation says: the sign of the reward does not
depend on the tick of the declaration, and one hypothesis, or type, of a segment is rewarded. The
reward of a segment therefore teaches all its rows: a rewarded declaration names the hypothesis,
another one excludes it, and the probabilities of the network at the last row say how likely each of
the others is. Nothing else is read: neither the true mode nor an estimate.

The memory of the network is a sum over the rows of the segment, as in Deep Sets (Zaheer et al.
2017): the tick is among the inputs, so that the order of the rows is not lost, and a whole segment
is processed at once in training.
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


class RewardNet(nn.Module):
    """Corrects the posterior of the bank, from the present row and a memory of the segment;
    `hidden` units a layer, and the `share` of the features of a row in the memory.
    """

    def __init__(self, hidden: int, share: float = 0.2):
        super().__init__()
        self.share = share
        self.row = nn.Sequential(
            nn.Linear(INPUTS, hidden), nn.SiLU(), nn.Linear(hidden, hidden), nn.Tanh()
        )
        self.layers = turn_layers(INPUTS + hidden, hidden)
        self.scale = nn.Parameter(torch.ones(1))

    def features(self, inputs: Tensor) -> Tensor:
        """Return features (N, M - 1, hidden) of rows; the memory is their sum from the first row
        of the segment.
        """
        return self.share * self.row(inputs)

    def forward(self, inputs: Tensor, memory: Tensor, logs: Tensor) -> Tensor:
        """Return the log-probability that the reward of declaring a hypothesis is positive, (N, M).

        Inputs and logarithms are of `row_inputs`, the memory (N, M - 1, hidden) is the sum of
        `features` so far.
        """
        outputs = self.layers(torch.cat([inputs, memory], -1))
        return torch.log_softmax(self.scale * logs + with_straight(outputs), -1)

    def whole(self, inputs: Tensor, logs: Tensor, lengths: Tensor) -> Tensor:
        """Return the same (n, M) of all rows of segments of `lengths` (S,) rows."""
        features = self.features(inputs)
        sums = features.cumsum(0)
        before = (sums - features)[lengths.cumsum(0) - lengths]
        return self(inputs, sums - before[places(lengths)[0]], logs)


class RewardDecider(SegmentDecider):
    """Declares once the probability of a negative reward is at most alpha; the state is the memory
    of the network (N, M - 1, hidden).
    """

    default = 0.03
    network = RewardNet

    def advance(self, rows: Rows, ticks: Tensor, state: Tensor | None) -> tuple[Tensor, Tensor]:
        inputs, logs = map(torch.from_numpy, row_inputs(rows))
        memory = self.net.features(inputs)
        if state is not None:
            memory = memory + torch.where((ticks > 1)[:, None, None], state, 0.0)
        return self.net(inputs, memory, logs).double().exp(), memory


class Reward(SegmentAlgorithm):
    """A training run on rewards alone."""

    decider = RewardDecider

    def loss(self, inputs: list[Tensor], segments: Segments) -> Tensor:
        """Return the mean cross-entropy of the rewarded hypothesis over all rows."""
        lengths, declared, rewarded = segments
        logs = self.net.whole(*inputs, lengths)
        groups = torch.from_numpy(self.world.groups)
        with torch.no_grad():
            possible = (groups[declared][:, None] == groups) == rewarded[:, None]
            target = possible * logs[lengths.cumsum(0) - 1].exp().clamp(min=1e-9)
            target /= target.sum(-1, keepdim=True)
        return -(target[places(lengths)[0]] * logs).sum(-1).mean()
