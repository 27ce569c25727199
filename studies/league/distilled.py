"""The distilled agent, which imitates what the shipped agent states on its own rows.

As in DAgger (Ross et al. 2011) the student drives, so that it meets the anchors that follow its own
declarations, and the teacher is asked on every row.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents import find_decider
from studies.league.segments import (
    INPUTS,
    Rows,
    SegmentAlgorithm,
    SegmentDecider,
    Segments,
    row_inputs,
    turn_layers,
    with_straight,
)


class DistilledNet(nn.Module):
    """Corrects the posterior of the bank, from the present row alone; `hidden` units a layer."""

    def __init__(self, hidden: int):
        super().__init__()
        self.layers = turn_layers(INPUTS, hidden)
        self.scale = nn.Parameter(torch.ones(1))

    def forward(self, inputs: Tensor, logs: Tensor) -> Tensor:
        """Return the logarithms of the posterior (N, M) of rows, see `row_inputs`."""
        return torch.log_softmax(self.scale * logs + with_straight(self.layers(inputs)), -1)


class DistilledDecider(SegmentDecider):
    """Declares once the error probability is at most alpha. It has no state."""

    network = DistilledNet

    def advance(self, rows: Rows, ticks: Tensor, state: Any) -> tuple[Tensor, None]:
        inputs = map(torch.from_numpy, row_inputs(rows))
        return self.net(*inputs).double().exp(), None


class Distilled(SegmentAlgorithm):
    """A training run on the posterior of the shipped agent, at three measurement variances in
    turn, one for each round.
    """

    decider = DistilledDecider

    def prepare(self) -> None:
        super().prepare()
        variance = np.asarray(self.world.measurement_variance)
        changed = [self.make_env(measurement_variance=(k * variance).tolist()) for k in (0.1, 10.0)]
        self.envs = [self.env, *changed]

    def train_round(self) -> tuple[int, float, float, dict[str, float]]:
        self.env = self.envs[self.rounds % len(self.envs)]
        return super().train_round()

    def inputs(self, rows: Rows, lengths: NDArray[np.int64]) -> tuple[NDArray[Any], ...]:
        """See `SegmentAlgorithm.inputs`; also the posterior of the teacher on each row."""
        world = self.env.options
        teacher = find_decider("shipped", world)
        counts = lengths.reshape(-1, world.segments).sum(1)
        return *super().inputs(rows, lengths), taught(teacher, rows, counts).astype(np.float32)

    def loss(self, inputs: list[Tensor], segments: Segments) -> Tensor:
        """Return the mean cross-entropy of the posterior of the teacher, (n, M)."""
        *of_rows, teaching = inputs
        return -(teaching * self.net(*of_rows)).sum(-1).mean()


def taught(teacher: Any, rows: Rows, counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the posterior (n, M) of a decider on rows (n, width) of whole episodes, each of
    `counts` (E,) rows.
    """
    out = np.empty((len(rows), teacher.layout.hypotheses))
    begins = counts.cumsum() - counts
    left = np.arange(len(counts))
    state = None
    for tick in range(counts.max()):
        goes_on = counts[left] > tick
        if not goes_on.all():
            left, state = left[goes_on], teacher.select_tracks(state, goes_on)
        now = begins[left] + tick
        out[now], state = teacher.posterior(rows[now], state, np.full(len(left), tick == 0))
    return out
