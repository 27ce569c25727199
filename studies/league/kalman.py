"""KalmanNet: a Kalman filter whose gain, and innovation covariance, a recurrent network learns;
and it as a decider.

Revach et al. 2022, "KalmanNet: neural network aided Kalman filtering for partially known dynamics",
IEEE Transactions on Signal Processing 70. The motion and measurement model is known, the noise
covariances are not. A GRU reads differences that tell how well the filter follows, and returns the
gain. Here the filter has a likelihood too: the memory of the GRU before a measurement gives the
covariance of its innovation. Without training the gain is zero.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.statement_net import sides, zero_layer
from baselines.rules.decider import Observations
from hybrid_env.checks import BoolArray
from hybrid_env.observation import Layout
from studies.league.reward import RewardDecider, SegmentAlgorithm, Segments, SegmentSettings

# The differences are compressed to +-3.
LARGEST_INPUT = 3.0
LARGEST_CONTEXT = 5.0
# From the path of a hypothesis, over the scale.
LARGEST_DEVIATION = 1e6
# Magnitude of the logarithm of a deviation of the innovation.
LARGEST_LOG = 12.0

# Of the inputs of a filter.
RESIDUAL, TURN, SCALE, CONTEXT = slice(0, 2), 2, slice(3, 4), slice(4, 9)
SMALLEST = 1e-12
SENSOR = torch.eye(
    2,
    4,
    dtype=torch.float32,
    device="cpu",
)


class KalmanState(NamedTuple):
    """State of N filters of m states and n measurements."""

    # (N, m) estimate after the last measurement.
    state: Tensor
    # (N, hidden) of the GRU.
    memory: Tensor
    # (N, n) last one.
    measurement: Tensor
    # (N, m) last difference of two estimates.
    evolution: Tensor
    # (N, m) last difference of the estimate and its prediction.
    update: Tensor


class KalmanNet(nn.Module):
    """The filter of a linear model of m states and n measurements.

    `hidden` units of the GRU, which reads `context` further numbers at every measurement.
    """

    def __init__(self, states: int, measurements: int, hidden: int, context: int = 0):
        super().__init__()
        self.measurements = measurements
        inputs = 2 * (states + measurements) + context
        self.before = nn.Sequential(nn.Linear(inputs, hidden), nn.SiLU())
        self.recurrent = nn.GRUCell(hidden, hidden)
        self.gain = nn.Sequential(
            nn.Linear(hidden, hidden),
            nn.SiLU(),
            zero_layer(hidden, states * measurements),
            nn.Unflatten(-1, (states, measurements)),
        )
        entries = measurements * (measurements + 1) // 2
        self.covariance = nn.Sequential(
            nn.Linear(hidden, hidden),
            nn.SiLU(),
            zero_layer(hidden, entries),
        )

    def start(self, state: Tensor, measurement: Tensor) -> KalmanState:
        """Return filters that start at estimates (N, m), with the measurements (N, n) that these
        predict.
        """
        nothing = torch.zeros_like(state)
        memory = state.new_zeros(len(state), self.recurrent.hidden_size)
        return KalmanState(
            state,
            memory,
            measurement,
            nothing,
            nothing,
        )

    def step(
        self,
        last: KalmanState,
        motion: Tensor,
        sensor: Tensor,
        measurement: Tensor,
        scale: Tensor,
        context: Tensor | None = None,
    ) -> tuple[KalmanState, Tensor]:
        """Return the filters after a measurement (N, n), and its log-likelihood given those
        before, (N,).

        Matrices from state to state are (m, m) or (N, m, m), from state to measurement (n, m); the
        scale (N, 1) is a typical deviation of an innovation, in the unit of state and measurement;
        the context (N, context) is read too.
        """
        predicted = (motion @ last.state[..., None])[..., 0]
        innovation = measurement - predicted @ sensor.T
        differences = (
            torch.cat([innovation, measurement - last.measurement, last.evolution, last.update], -1)
            / scale
        )
        inputs = LARGEST_INPUT * torch.tanh(differences / LARGEST_INPUT)
        inputs = inputs if context is None else torch.cat([inputs, context], -1)
        memory = self.recurrent(self.before(inputs), last.memory)
        update = (self.gain(memory) @ innovation[..., None])[..., 0]
        # From the memory before the measurement, or the density would be none.
        logs, below = self.covariance(last.memory).tensor_split((self.measurements,), -1)
        state = predicted + update
        after = KalmanState(
            state,
            memory,
            measurement,
            state - last.state,
            update,
        )
        return after, normal_log_density(
            innovation / scale,
            logs,
            below,
        ) - self.measurements * scale.log()[..., 0]


def normal_log_density(values: Tensor, logs: Tensor, below: Tensor) -> Tensor:
    """Return the logarithm of the density (...) of normal vectors (..., n) with zero mean.

    The inverse of the Cholesky factor of the covariance has the logarithms -`logs` (..., n) on its
    diagonal, and the entries `below` (..., n (n - 1) / 2) under it, row by row.
    """
    n = values.shape[-1]
    logs = LARGEST_LOG * torch.tanh(logs / LARGEST_LOG)
    inverse = torch.diag_embed(torch.exp(-logs))
    rows, columns = torch.tril_indices(
        n,
        n,
        -1,
    )
    inverse[..., rows, columns] = below
    whitened = (inverse @ values[..., None])[..., 0]
    return -(0.5 * whitened.square() + logs).sum(-1) - 0.5 * n * math.log(2.0 * math.pi)


def filter_inputs(rows: NDArray[np.float32], tau: float) -> NDArray[np.float32]:
    """Return the inputs of the M + 1 filters of each track, (N, M + 1, 9), from rows (N, width)
    and the tick tau [s].

    A filter estimates the deviation from the path that its hypothesis predicts from the anchor,
    along and across this path, in deviations of the measurement noise. It sees it from the side of
    its turn; straight motion has no side and therefore two filters, the first ones. A mirrored
    trajectory gives the same inputs for the mirrored turns.
    """
    layout = Layout.of_rows(rows)
    read = {name: layout.read(rows, name) for name in layout.slices}
    side = np.concatenate([[1.0, -1.0], sides(layout.hypotheses)[1:]])
    speed = np.maximum(read["speed"] * tau * np.exp(-0.5 * read["log_noise"]), SMALLEST)[:, None]
    turn = np.abs(read["curvature"]) * (read["speed"] * tau)[:, None]
    turn = np.concatenate([turn[:, :1], turn], -1)
    angle = turn * read["ticks"][:, None]
    way = speed * read["ticks"][:, None]
    along = read["displacement_along"][:, None] - way * np.sinc(angle / np.pi)
    across = (
        side * read["displacement_across"][:, None]
        - 0.5 * way * angle * np.sinc(0.5 * angle / np.pi) ** 2
    )
    cosine = np.cos(angle)
    sine = np.sin(angle)
    xx = read["anchor_xx"]
    xv = read["anchor_xv"] * tau
    vv = read["anchor_vv"] * tau * tau
    scale = np.sqrt(np.maximum(1.0 + xx + 2.0 * xv + vv, 1.0))
    of_track = [
        scale,
        0.5 * np.log(np.maximum(xx, SMALLEST)),
        xv / scale**2,
        0.5 * np.log(np.maximum(vv, SMALLEST)) + 2.0,
        0.5 * np.log(speed[:, 0]),
    ]
    out = np.empty((*turn.shape, 9), np.float32)
    for k, deviation in enumerate((cosine * along + sine * across, cosine * across - sine * along)):
        out[..., k] = np.clip(
            deviation / scale[:, None],
            -LARGEST_DEVIATION,
            LARGEST_DEVIATION,
        )
    out[..., :2] *= scale[:, None, None]
    out[..., TURN] = turn
    out[..., 3:8] = np.stack(of_track, -1)[:, None]
    out[..., 8] = 10.0 * turn
    return out


class KalmanBank(KalmanNet):
    """The filters of all hypotheses, which share one network; see `filter_inputs`."""

    def __init__(self, hidden: int):
        super().__init__(
            4,
            2,
            hidden,
        )
        self.context = nn.Sequential(nn.Linear(CONTEXT.stop - CONTEXT.start, hidden), nn.Tanh())

    def begin(self, inputs: Tensor) -> KalmanState:
        """Return filters at the anchor, from their first inputs (n, 9)."""
        nothing = inputs.new_zeros(len(inputs), 4)
        context = inputs[:, CONTEXT].clamp(-LARGEST_CONTEXT, LARGEST_CONTEXT)
        return self.start(nothing, nothing[:, :2])._replace(memory=self.context(context))

    def advance(self, last: KalmanState, inputs: Tensor) -> tuple[KalmanState, Tensor]:
        """Process the inputs (n, 9) of a tick; return the filters and the log-likelihoods (n,)."""
        return self.step(
            last,
            turning(inputs[:, TURN]),
            SENSOR,
            inputs[:, RESIDUAL],
            inputs[:, SCALE],
        )


def turning(turn: Tensor) -> Tensor:
    """Return the matrices (n, 4, 4) of deviations from a path that turns by an angle (n,) per tick.

    The state is the deviation of the position and of the velocity [1/tick], along and across the
    path.
    """
    cosine = turn.cos()
    sine = turn.sin()
    forward = torch.sinc(turn / math.pi)
    sideways = 0.5 * turn * torch.sinc(0.5 * turn / math.pi).square()
    one = torch.ones_like(turn)
    zero = torch.zeros_like(turn)
    entries = [
        cosine,
        sine,
        forward,
        sideways,
        -sine,
        cosine,
        -sideways,
        forward,
        zero,
        zero,
        one,
        zero,
        zero,
        zero,
        zero,
        one,
    ]
    return torch.stack(entries, -1).unflatten(-1, (4, 4))


def evidence(logs: Tensor) -> Tensor:
    """Return the log-likelihoods of the hypotheses (..., M) from those of the filters (..., M +
    1).
    """
    return torch.cat([logs[..., :2].mean(-1, keepdim=True), logs[..., 2:]], -1)


class KalmanMemory(NamedTuple):
    """State of N tracks."""

    # Of N (M + 1) filters.
    filters: KalmanState
    # (N, M + 1) their log-likelihoods since the anchor.
    logs: Tensor


class KalmanDecider(RewardDecider):
    """Declares the likeliest hypothesis once its posterior by the learned filters, with equal
    priors, is 1 - alpha.
    """

    default = 0.02
    network = KalmanBank
    label = "learned Kalman gain"

    def advance(
        self,
        rows: Observations,
        ticks: Tensor,
        state: KalmanMemory | None,
    ) -> tuple[Tensor, KalmanMemory]:
        inputs = torch.from_numpy(filter_inputs(rows, self.world.tau)).flatten(0, 1)
        filters = self.net.begin(inputs)
        before = torch.zeros(len(rows), self.layout.hypotheses + 1)
        if state is not None:
            goes_on = (ticks > 1)[:, None]
            each = goes_on.repeat_interleave(before.shape[1], 0)
            pairs = zip(
                state.filters,
                filters,
                strict=True,
            )
            filters = KalmanState(
                *(
                    torch.where(
                        each,
                        old,
                        new,
                    )
                    for old, new in pairs
                )
            )
            before = torch.where(
                goes_on,
                state.logs,
                before,
            )
        filters, logs = self.net.advance(filters, inputs)
        logs = before + logs.view_as(before)
        return torch.softmax(evidence(logs).double(), -1), KalmanMemory(filters, logs)

    def select_tracks(self, state: Any, tracks: BoolArray) -> KalmanMemory | None:
        """See `RewardDecider.select_tracks`; every track has M + 1 filters."""
        if state is None:
            return None
        each = np.repeat(tracks, state.logs.shape[1])
        return KalmanMemory(
            super().select_tracks(state.filters, each),
            state.logs[torch.from_numpy(tracks)],
        )


class Kalman(SegmentAlgorithm):
    """A training run of KalmanNet, without the true states."""

    Settings = SegmentSettings
    decider = KalmanDecider
    measure = "negative_log_likelihood"

    @staticmethod
    def inputs(rows: Observations, tau: float) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the inputs of the filters (n, M + 1, 9), and the ticks (n,)."""
        return filter_inputs(rows, tau), Layout.of_rows(rows).read(rows, "ticks")

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        """See `SegmentAlgorithm.labels`: the true modes (S,)."""
        return (found.modes,)

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the negative log-likelihood of a measurement by the true filter, and the
        cross-entropy of a row.
        """
        found, inside = segment_logs(
            self.net,
            inputs,
            lengths,
        )
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
