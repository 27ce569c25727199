"""The distilled agent, which imitates what the shipped agent states on its own rows.

As in DAgger (Ross et al. 2011) the student drives, so that it meets the anchors that follow its own
declarations, and the teacher is asked on every row.
"""

from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents import PosteriorDecider, find_decider
from studies.league.segments import (
    GAIN,
    INPUTS,
    Rows,
    SegmentAlgorithm,
    SegmentDecider,
    Segments,
    hidden_layers,
    row_inputs,
    with_straight,
    zero_layer,
)


class DistilledNet(nn.Module):
    """Corrects the posterior of the bank, from the present row alone; `hidden` units a layer."""

    def __init__(self, hidden: int):
        super().__init__()
        self.layers = hidden_layers(INPUTS, hidden)
        self.output = zero_layer(hidden, 2)
        self.scale = nn.Parameter(torch.ones(1))

    def forward(self, inputs: Tensor, logs: Tensor) -> Tensor:
        """Return the logarithms of the posterior (N, M) of rows, see `row_inputs`."""
        outputs = GAIN * self.output(self.layers(inputs))
        return torch.log_softmax(
            self.scale * logs + with_straight(outputs),
            -1,
        )


class DistilledDecider(SegmentDecider):
    """Declares once the error probability is at most alpha. It has no state."""

    network = DistilledNet
    label = "distilled agent"

    def advance(self, rows: Rows, ticks: Tensor, state: Any) -> tuple[Tensor, None]:
        inputs = map(torch.from_numpy, row_inputs(rows, self.world.tau))
        return self.net(*inputs).double().exp(), None


class Distilled(SegmentAlgorithm):
    """A training run on the posterior of the shipped agent, at three measurement variances in
    turn, one for each round.
    """

    decider = DistilledDecider

    def build(self) -> None:
        super().build()
        variance = np.asarray(self.world.measurement_variance)
        changed = [self.make_env(measurement_variance=(k * variance).tolist()) for k in (0.1, 10.0)]
        self.envs = [self.env, *changed]

    def train_round(self) -> tuple[int, float, float, dict[str, float]]:
        self.env = self.envs[self.rounds % len(self.envs)]
        return super().train_round()

    def labels(self, found: Segments) -> tuple[NDArray[Any], ...]:
        """See `SegmentAlgorithm.labels`: the posterior of the teacher on each row."""
        world = self.env.options
        decider = cast("PosteriorDecider", find_decider("shipped-threshold", world))
        counts = found.lengths.reshape(-1, world.segments).sum(1)
        return (
            taught(
                decider,
                found.rows,
                counts,
            ).astype(np.float32),
        )

    def loss(self, inputs: list[Tensor], lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the mean cross-entropy of the posterior of the teacher, (n, M)."""
        return -(labels[0] * self.net(*inputs)).sum(-1).mean()


def taught(
    teacher: PosteriorDecider,
    rows: Rows,
    counts: NDArray[np.int64],
) -> NDArray[np.float64]:
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
        out[now], state = teacher.posterior(
            rows[now],
            state,
            np.full(len(left), tick == 0),
        )
    return out
