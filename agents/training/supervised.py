"""Supervised training on the segments of `RewardRun`.

MSPRT-TANDEM, KalmanNet and the transformer learn from their true modes. The distilled agent
imitates what the shipped agent states on its own rows: as in DAgger (Ross et al. 2011) the student
drives, so that it meets the anchors that follow its own declarations, and the teacher is asked on
every row.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.evaluation.registry import find_family
from agents.learned.kalman_net import KalmanBank, KalmanDecider, evidence, filter_inputs
from agents.learned.posterior_decider import PosteriorDecider
from agents.learned.reward_net import DistilledDecider
from agents.learned.tandem_net import TandemDecider, WindowNet, log_ratios, windows_of
from agents.learned.transformer_net import TransformerDecider, raw_inputs
from agents.training.reward import RewardRun, Segments
from agents.training.run import Round
from baselines.rules.decider import Observations
from hybrid_env.checks import FloatArray, IntArray, reject
from hybrid_env.observation import Layout
from hybrid_env.registration import make_vector_env


class TrueModesRun(RewardRun):
    """Base class of the runs; `labels` of the loss are the true modes (S,) of the segments."""

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        return (found.modes,)


class TransformerRun(TrueModesRun):
    """A training run of `TransformerNet`."""

    decider = TransformerDecider
    inputs = staticmethod(raw_inputs)

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the mean cross-entropy of the true modes over all rows."""
        return nn.functional.nll_loss(
            self.net(inputs, lengths),
            labels[0].repeat_interleave(lengths),
        )


class TandemRun(TrueModesRun):
    """A training run of MSPRT-TANDEM."""

    decider = TandemDecider
    measure = "log_sum_exp"

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


class KalmanRun(TrueModesRun):
    """A training run of KalmanNet, without the true states."""

    decider = KalmanDecider
    measure = "negative_log_likelihood"

    @staticmethod
    def inputs(rows: Observations, tau: float) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the inputs of the filters (n, M + 1, 9), and the ticks (n,)."""
        return filter_inputs(rows, tau), Layout.of_rows(rows).read(rows, "ticks")

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the negative log-likelihood of a measurement by the true filter, and the
        cross-entropy of a row.
        """
        found, inside = segment_logs(self.net, inputs, lengths)
        true = labels[0].expand(inside.shape)[..., None]
        likelihood = found.gather(-1, true)[..., 0][inside].mean()
        return (
            nn.functional.cross_entropy(found.cumsum(0)[inside], true[..., 0][inside]) - likelihood
        )


def segment_logs(net: KalmanBank, inputs: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
    """Return the log-likelihoods of every measurement (T, S, M), and which are inside their
    segments (T, S).

    The inputs (n, M + 1, 9) are those of all segments of `lengths` (S,) rows, one after the other.
    """
    ticks = torch.arange(int(lengths.max()))[:, None]
    rows = torch.minimum(ticks, lengths - 1) + lengths.cumsum(0) - lengths
    padded = inputs[rows].flatten(1, 2)
    filters = net.begin(padded[0])
    found = []
    for each in padded:
        filters, logs = net.advance(filters, each)
        found.append(logs)
    return evidence(torch.stack(found).unflatten(1, (len(lengths), -1))), ticks < lengths


FACTORS = 1.0, 0.1, 10.0
"""Of the measurement variance of the environment, in turn, one for each round."""


class DistilledRun(RewardRun):
    """A training run on the posterior of the shipped agent; it refuses sensors, which are not in
    the rows.
    """

    decider = DistilledDecider

    def build(self) -> None:
        """See `RewardRun.build`; creates an environment for every measurement variance."""
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
        """See `RewardRun.labels`: the posterior of the teacher on each row."""
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
