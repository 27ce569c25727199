"""KalmanNet: a Kalman filter whose gain, and innovation covariance, a recurrent network learns;
and it as a decider.

Revach et al. 2022, "KalmanNet: neural network aided Kalman filtering for partially known dynamics",
IEEE Transactions on Signal Processing 70. The motion and measurement model is known, the noise
covariances are not. A GRU reads differences that tell how well the filter follows, and returns the
gain. Here the filter has a likelihood too: the memory of the GRU before a measurement gives the
covariance of its innovation. Without training the gain is zero.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from hybrid_env import Layout
from studies.league.segments import (
    Rows,
    SegmentAlgorithm,
    SegmentDecider,
    Segments,
    sides,
    where,
    zero_layer,
)


class KalmanState(NamedTuple):
    """State of filters (...)."""

    # (..., 4) estimate of position and velocity after the last measurement.
    state: Tensor
    # (..., hidden) of the GRU.
    memory: Tensor
    # (..., 2) last one.
    measurement: Tensor
    # (..., 4) last difference of two estimates.
    evolution: Tensor
    # (..., 4) last difference of the estimate and its prediction.
    update: Tensor


class KalmanNet(nn.Module):
    """The filter of a linear motion in the plane, whose positions are measured, with `hidden` units
    of the GRU.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.before = nn.Sequential(nn.Linear(12, hidden), nn.SiLU())
        self.recurrent = nn.GRUCell(hidden, hidden)
        self.gain = nn.Sequential(
            nn.Linear(hidden, hidden), nn.SiLU(), zero_layer(hidden, 8), nn.Unflatten(-1, (4, 2))
        )
        # Two logarithms, and an entry below them.
        self.covariance = nn.Sequential(nn.Linear(hidden, hidden), nn.SiLU(), zero_layer(hidden, 3))

    def start(self, state: Tensor, measurement: Tensor) -> KalmanState:
        """Return filters that start at estimates (..., 4), with the measurements (..., 2) that
        these predict.
        """
        nothing = torch.zeros_like(state)
        memory = state.new_zeros(*state.shape[:-1], self.recurrent.hidden_size)
        return KalmanState(state, memory, measurement, nothing, nothing)

    def step(
        self, last: KalmanState, motion: Tensor, measurement: Tensor, scale: Tensor
    ) -> tuple[KalmanState, Tensor]:
        """Return the filters after a measurement (..., 2), and its log-likelihood given those
        before, (...).

        The motion are matrices (..., 4, 4); the scale (..., 1) is a typical deviation of an
        innovation, in the unit of state and measurement.
        """
        predicted = (motion @ last.state[..., None])[..., 0]
        innovation = measurement - predicted[..., :2]
        steps = innovation, measurement - last.measurement, last.evolution, last.update
        # Compressed to +-3.
        read = self.before(3.0 * torch.tanh(torch.cat(steps, -1) / scale / 3.0))
        memory = self.recurrent(read.flatten(0, -2), last.memory.flatten(0, -2)).view_as(read)
        update = (self.gain(memory) @ innovation[..., None])[..., 0]
        # From the memory before the measurement, or the density would be none. The inverse of the
        # Cholesky factor has the logarithms with the other sign, compressed to +-12, on its
        # diagonal.
        logs, below = self.covariance(last.memory).split([2, 1], -1)
        logs = 12.0 * torch.tanh(logs / 12.0)
        inverse = torch.diag_embed(torch.exp(-logs))
        inverse[..., 1, 0] = below[..., 0]
        whitened = (inverse @ (innovation / scale)[..., None])[..., 0]
        density = -(0.5 * whitened.square() + logs).sum(-1) - math.log(2.0 * math.pi)
        state = predicted + update
        after = KalmanState(state, memory, measurement, state - last.state, update)
        return after, density - 2 * scale[..., 0].log()


def filter_sides(hypotheses: int) -> Rows:
    """Return the sides (M + 1,) from which filters see a track: that of their turn; straight motion
    has none and therefore two filters, the first ones.
    """
    return np.concatenate([[1.0, -1.0], sides(hypotheses)[1:]])


def filter_inputs(rows: Rows) -> tuple[Rows]:
    """Return the inputs of the M + 1 filters of each track, (N, M + 1, 9), from rows (N,
    width).

    A filter estimates the deviation from the path that its hypothesis predicts from the anchor,
    along and across this path, in deviations of the measurement noise. A mirrored trajectory gives
    the same inputs for the mirrored turns. The columns are the deviation (2), the angle of a tick,
    the scale of an innovation, and the context at the anchor (5).
    """
    layout = Layout.of_rows(rows)
    read = {name: layout.read(rows, name) for name in layout.slices}
    smallest = 1e-12
    speed = np.maximum(read["speed"], smallest)[:, None]
    turn = np.abs(read["turn_angle"])
    turn = np.concatenate([turn[:, :1], turn], -1)
    angle = turn * read["ticks"][:, None]
    way = speed * read["ticks"][:, None]
    along = read["displacement_along"][:, None] - way * np.sinc(angle / np.pi)
    across = (
        filter_sides(layout.hypotheses) * read["displacement_across"][:, None]
        - 0.5 * way * angle * np.sinc(0.5 * angle / np.pi) ** 2
    )
    cosine, sine = np.cos(angle), np.sin(angle)
    xx, xv, vv = read["anchor_xx"], read["anchor_xv"], read["anchor_vv"]
    scale = np.sqrt(np.maximum(1.0 + xx + 2.0 * xv + vv, 1.0))
    of_track = [
        scale,
        0.5 * np.log(np.maximum(xx, smallest)),
        xv / scale**2,
        0.5 * np.log(np.maximum(vv, smallest)) + 2.0,
        0.5 * np.log(speed[:, 0]),
    ]
    out = np.empty((*turn.shape, 9), np.float32)
    for k, deviation in enumerate((cosine * along + sine * across, cosine * across - sine * along)):
        out[..., k] = np.clip(deviation / scale[:, None], -1e6, 1e6)
    out[..., :2] *= scale[:, None, None]
    out[..., 2] = turn
    out[..., 3:8] = np.stack(of_track, -1)[:, None]
    out[..., 8] = 10.0 * turn
    return (out,)


class KalmanBank(KalmanNet):
    """The filters of all hypotheses, which share one network; see `filter_inputs`."""

    def __init__(self, hidden: int):
        super().__init__(hidden)
        self.context = nn.Sequential(nn.Linear(5, hidden), nn.Tanh())

    def begin(self, inputs: Tensor) -> KalmanState:
        """Return filters at the anchor, from their first inputs (..., 9)."""
        nothing = inputs.new_zeros(*inputs.shape[:-1], 4)
        memory = self.context(inputs[..., 4:].clamp(-5.0, 5.0))
        return self.start(nothing, nothing[..., :2])._replace(memory=memory)

    def advance(self, last: KalmanState, inputs: Tensor) -> tuple[KalmanState, Tensor]:
        """Process the inputs (..., 9) of a tick; return the filters and the log-likelihoods
        (...).
        """
        return self.step(last, turning(inputs[..., 2]), inputs[..., :2], inputs[..., 3:4])


def turning(turn: Tensor) -> Tensor:
    """Return the matrices (..., 4, 4) of deviations from a path that turns by an angle (...) per
    tick.

    The state is the deviation of the position and of the velocity [1/tick], along and across the
    path.
    """
    half = 0.5 * turn
    forward = torch.sinc(turn / math.pi)
    sideways = half * torch.sinc(half / math.pi).square()
    rotation = two_by_two(turn.cos(), turn.sin())
    above = torch.cat([rotation, two_by_two(forward, sideways)], -1)
    below = nn.functional.pad(torch.eye(2).expand_as(rotation), (2, 0))
    return torch.cat([above, below], -2)


def two_by_two(diagonal: Tensor, above: Tensor) -> Tensor:
    """Return the matrices (..., 2, 2) [[diagonal, above], [-above, diagonal]]."""
    entries = torch.stack([diagonal, above, -above, diagonal], -1)
    return entries.unflatten(-1, (2, 2))


def evidence(logs: Tensor) -> Tensor:
    """Return the log-likelihoods of the hypotheses (..., M) from those of the filters (..., M +
    1).
    """
    return torch.cat([logs[..., :2].mean(-1, keepdim=True), logs[..., 2:]], -1)


class KalmanDecider(SegmentDecider):
    """Declares once the posterior by the learned filters, with equal priors, is 1 - alpha.

    The state are the filters (N, M + 1), and their log-likelihoods since the anchor (N, M + 1).
    """

    network = KalmanBank

    def advance(self, rows: Rows, ticks: Tensor, state: Any) -> tuple[Tensor, Any]:
        inputs = torch.from_numpy(filter_inputs(rows)[0])
        last = self.net.begin(inputs), inputs.new_zeros(inputs.shape[:-1])
        if state is not None:
            last = where(ticks > 1, state, last)
        filters, logs = self.net.advance(last[0], inputs)
        logs = last[1] + logs
        return torch.softmax(evidence(logs).double(), -1), (filters, logs)


class Kalman(SegmentAlgorithm):
    """A training run of KalmanNet, without the true states."""

    decider = KalmanDecider

    def inputs(self, rows: Rows, lengths: NDArray[np.int64]) -> tuple[Rows]:
        return filter_inputs(rows)

    def loss(self, inputs: list[Tensor], segments: Segments) -> Tensor:
        """Return the negative log-likelihood of a measurement by the true filter, and the
        cross-entropy of a row.
        """
        logs, inside = segment_logs(self.net, inputs[0], segments.lengths)
        true = segments.modes.expand(inside.shape)
        likelihood = logs.gather(-1, true[..., None])[..., 0][inside].mean()
        return nn.functional.cross_entropy(logs.cumsum(0)[inside], true[inside]) - likelihood


def segment_logs(net: KalmanBank, inputs: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
    """Return the log-likelihoods of every measurement (T, S, M), and which are inside their
    segments (T, S).

    The inputs (n, M + 1, 9) are those of all segments of `lengths` (S,) rows, one after the other.
    """
    ticks = torch.arange(int(lengths.max()))[:, None]
    rows = torch.minimum(ticks, lengths - 1) + lengths.cumsum(0) - lengths
    padded = inputs[rows].flatten(1, 2)
    filters = net.begin(padded[0])
    logs = []
    for each in padded:
        filters, of_tick = net.advance(filters, each)
        logs.append(of_tick)
    return evidence(torch.stack(logs).unflatten(1, (len(lengths), -1))), ticks < lengths
