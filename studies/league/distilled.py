"""The distilled agent, which imitates what the shipped agent states on its own rows.

As in DAgger (Ross et al. 2011) the student drives, so that it meets the anchors that follow its own
declarations, and the teacher is asked on every row.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.evaluation.registry import find_family
from agents.learned.posterior_decider import PosteriorDecider
from agents.learned.statement_net import GAIN, zero_layer
from agents.training.algorithm import Round
from baselines.rules.decider import Observations
from hybrid_env.checks import FloatArray, IntArray, reject
from hybrid_env.registration import make_vector_env
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

FACTORS = 1.0, 0.1, 10.0
"""Of the measurement variance of the environment, in turn, one for each round."""


class DistilledNet(nn.Module):
    """As `RewardNet`, from the present row alone; it imitates the shipped agent."""

    def __init__(self, hidden: int):
        super().__init__()
        self.layers = hidden_layers(INPUTS, hidden)
        self.output = zero_layer(hidden, 2)
        self.scale = nn.Parameter(torch.ones(1))

    def forward(self, inputs: Tensor, logs: Tensor) -> Tensor:
        """Return the logarithms of the posterior (N, M) of rows, see `reward_inputs`."""
        return torch.log_softmax(
            self.scale * logs + with_straight(GAIN * self.output(self.layers(inputs))),
            -1,
        )


class DistilledDecider(RewardDecider):
    """Declares the likeliest hypothesis once the error probability is at most alpha. It has no
    state.
    """

    network = DistilledNet
    label = "distilled agent"

    def advance(self, rows: Observations, ticks: Tensor, state: Any) -> tuple[Tensor, None]:
        return self.net(
            *map(torch.from_numpy, reward_inputs(rows, self.world.tau))
        ).double().exp(), None


class Distilled(SegmentAlgorithm):
    """A training run on the posterior of the shipped agent; it refuses sensors, which are not in
    the rows.
    """

    Settings = SegmentSettings
    decider = DistilledDecider

    def build(self) -> None:
        """See `SegmentAlgorithm.build`; creates an environment for every measurement variance."""
        super().build()
        if self.world.sensors:
            raise reject("sensors", self.world.sensors, "none, for an agent that reads rows alone")
        variance = np.asarray(self.world.measurement_variance)
        self.envs = [self.env]
        for factor in FACTORS[1:]:
            changed = self.options | {"measurement_variance": (factor * variance).tolist()}
            self.envs.append(
                make_vector_env(self.env_id, self.settings.n_envs, tick_info=False, **changed)
            )

    def train_round(self) -> Round:
        home = self.env
        self.env = self.envs[self.rounds % len(self.envs)]
        self.world = self.env.options
        try:
            return super().train_round()
        finally:
            self.env = home
            self.world = home.options

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        """See `SegmentAlgorithm.labels`: the posterior of the teacher on each row."""
        family = find_family("shipped-threshold", self.world)
        rows = found.lengths.reshape(-1, self.world.segments).sum(1)
        return (taught(family.make(family.default), found.rows, rows).astype(np.float32),)

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the mean cross-entropy of the posterior of the teacher, labels: (n, M)."""
        return -(labels[0] * self.net(inputs, logs)).sum(-1).mean()


def taught(teacher: PosteriorDecider, rows: Observations, counts: IntArray) -> FloatArray:
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
