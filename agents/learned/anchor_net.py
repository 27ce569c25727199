"""The networks of the anchor agent: the distribution of the anchor error, and the cost of a
wrong turn; their inputs.

The bank states a covariance of the anchor that is too small after turns and after wrong
declarations. The network predicts a mixture of normal distributions instead: the filters of every
component start from one of them. It is the learned counterpart of `baselines.rules.anchor_prior`,
for all worlds at once.

Another network predicts what a declaration of another turn costs in the next segment. The filter of
the declared turn follows the object to the switch and gives the next anchor. If the object turns
otherwise, that anchor is inaccurate, and the next decision is late or wrong. This cost is not in
the reward of the declaration itself.

The inputs have no units: lengths are divided by the standard deviation of a measurement or by the
distance per tick, times by the tick. Lateral quantities are mirrored to the side of the declared
turn, so that a mirrored trajectory gives the same inputs.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.statement_net import zero_layer
from baselines.rules.anchor_prior import MIRROR
from baselines.rules.component_filters import stated_covariance
from baselines.rules.decider import Observations
from baselines.rules.msprt import mode_types
from hybrid_env.checks import Float32Array, FloatArray, IntArray
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions

# Inputs are clipped to +-5.
LIMIT = 5.0
SMALLEST = 1e-12
# Inputs that do not depend on the declaration, and that do.
CONTEXT, PAIR = 7, 6
COMPONENTS = 4
LOWER = torch.tril_indices(4, 4, -1, device="cpu")
# Weight, mean, scales and correlations of a component.
NUMBERS = 1 + 4 + 4 + LOWER.shape[1]


class Scales(NamedTuple):
    """What the inputs need from the options of the worlds of N tracks, each (N,)."""

    # Length of a tick [s].
    tau: FloatArray
    # sqrt(Q) [m/s].
    process_deviation: FloatArray
    # 1 or 0.
    follows_bank: FloatArray
    # 1 or 0.
    anchor_aware: FloatArray

    @classmethod
    def of(cls, worlds: Sequence[WorldOptions], tracks: Sequence[int]) -> "Scales":
        """Return the scales of several worlds, each with a number of tracks."""
        values = [
            (w.tau, np.sqrt(w.process_variance), w.follow == "bank", w.bank == "anchor_aware")
            for w in worlds
        ]
        return cls(*np.repeat(np.array(values, np.float64), tracks, axis=0).T)


class LastRow(NamedTuple):
    """What is remembered of the row before a switch, on which the declaration was made."""

    # (N, M) of the hypotheses.
    posterior: FloatArray
    # (N, C) posterior of the components of the anchor.
    components: FloatArray
    # (N, M, 2) see `bias_of_bank`
    bias: FloatArray
    # (N,) of the row, as the others.
    ticks: FloatArray
    ticks_left: FloatArray
    speed: FloatArray


Arrays = TypeVar("Arrays", Scales, LastRow)


def select(arrays: Arrays, tracks: NDArray[Any]) -> Arrays:
    """Return the arrays of selected tracks, by a mask (N,) or indices."""
    return type(arrays)(*(part[tracks] for part in arrays))


def _log(values: FloatArray) -> FloatArray:
    return np.log(np.maximum(values, SMALLEST))


def log_odds(probability: FloatArray, smallest: float = SMALLEST) -> FloatArray:
    """Return the log-odds of probabilities, at least the smallest one away from 0 and 1."""
    inside = np.clip(probability, smallest, 1.0 - smallest)
    return np.log(inside) - np.log1p(-inside)


def turns_per_tick(layout: Layout, rows: Observations, scales: Scales) -> FloatArray:
    """Return the turn angle per tick of each hypothesis at the speed of the anchor, (N, M)
    [rad].
    """
    return layout.read(rows, "curvature") * (layout.read(rows, "speed") * scales.tau)[:, None]


def ratios(layout: Layout, rows: Observations, scales: Scales) -> tuple[FloatArray, ...]:
    """Return the logarithms of distance per tick / sqrt(R), of sqrt(Q) / speed, of sqrt(Q) /
    sqrt(R) per tick, and of the variances of the anchor over R; each (N,).
    """
    log_speed = _log(layout.read(rows, "speed"))
    log_tick = np.log(scales.tau)
    log_deviation = 0.5 * layout.read(rows, "log_noise")
    log_process = np.log(np.maximum(scales.process_deviation, 1e-150))
    return (
        log_speed + log_tick - log_deviation,
        log_process - log_speed,
        log_process + log_tick - log_deviation,
        _log(layout.read(rows, "anchor_xx")),
        np.log(np.maximum(layout.read(rows, "anchor_vv"), 1e-150)) + 2.0 * log_tick,
    )


def posterior_within(posterior: FloatArray, modes: IntArray) -> FloatArray:
    """Return the posterior (N, M) of the hypotheses of the type of each mode (N,), given this
    type.
    """
    kind = mode_types(posterior.shape[1])
    within = np.where(kind == kind[modes][:, None], posterior, 0.0)
    within /= np.maximum(within.sum(-1, keepdims=True), SMALLEST)
    return within


def declaration_context(layout: Layout, rows: Observations, scales: Scales) -> list[FloatArray]:
    """Return the arguments of `regret_inputs` after the turns for declarations at rows, (N,)
    each.
    """
    motion, process, *_ = ratios(layout, rows, scales)
    left = layout.read(rows, "ticks_left")
    return [motion, process, left, scales.follows_bank, scales.anchor_aware]


def clipped(columns: Sequence[FloatArray]) -> Float32Array:
    """Return inputs (..., K) within their limits from columns (...)."""
    return np.clip(np.stack(columns, axis=-1), -LIMIT, LIMIT).astype(np.float32)


def bias_of_bank(layout: Layout, rows: Observations, innovations: FloatArray) -> FloatArray:
    """Return the innovations of the bank minus own ones (N, M, 3), see `ComponentFilters`, over
    sqrt(R), (N, M, 2).

    The difference, along and across the heading, is that of the predicted positions: how far the
    filter of the bank has drifted.
    """
    deviation = np.exp(0.5 * layout.read(rows, "log_variance"))[..., None]
    names = ("innovation_along", "innovation_across")
    of_bank = np.stack([layout.read(rows, name) for name in names], axis=-1) * deviation
    log_noise = layout.read(rows, "log_noise")[:, None, None]
    return of_bank - innovations[..., :2] * np.exp(0.5 * (innovations[..., 2:] - log_noise))


def declared_side(layout: Layout, rows: Observations, last: LastRow) -> FloatArray:
    """Return the side of the turn that the anchor follows, (N,): 1 left, -1 right.

    After a straight segment it is the side with the larger posterior.
    """
    decided = layout.read(rows, "previous").argmax(-1)
    kind = mode_types(layout.hypotheses)
    left, right = (last.posterior[:, kind == motion_type].sum(-1) for motion_type in (1, 2))
    return np.select([kind[decided] == 1, kind[decided] == 2, left < right], [1.0, -1.0, -1.0], 1.0)


def anchor_inputs(
    layout: Layout,
    rows: Observations,
    scales: Scales,
    last: LastRow,
    side: FloatArray,
) -> Float32Array:
    """Return the inputs for the distribution of the anchor error, (N, 22 + C), at first rows of
    a segment (N, width).

    The posterior of the components before the switch is the last C inputs; `side` is that of
    `declared_side`.
    """
    tracks = np.arange(len(rows))
    kind = mode_types(layout.hypotheses)
    decided = layout.read(rows, "previous").argmax(-1)
    straight = decided == 0
    posterior = last.posterior
    of_type = np.stack(
        [posterior[:, kind == motion_type].sum(-1) for motion_type in range(3)], axis=-1
    )
    same = np.where(side > 0, 1, 2)
    other = np.where(side > 0, 2, 1)
    speed = layout.read(rows, "speed")
    turn = turns_per_tick(layout, rows, scales) * side[:, None]
    within = posterior_within(posterior, decided)
    deviation = turn - turn[tracks, decided][:, None]
    mean = (within * deviation).sum(-1)
    spread = np.sqrt((within * deviation**2).sum(-1))
    motion, process, noise, position, velocity = ratios(layout, rows, scales)
    xx, xv, vv = (layout.read(rows, name) for name in ("anchor_xx", "anchor_xv", "anchor_vv"))
    variance = layout.read(rows, "anchor_vv") * np.exp(layout.read(rows, "log_noise"))
    variance = variance + scales.process_deviation**2 * (last.ticks + last.ticks_left)
    columns = [
        np.where(straight, 0.0, 0.5 * (_log(np.abs(turn[tracks, decided])) + 3.0)),
        straight.astype(np.float64),
        0.2 * log_odds(posterior[tracks, decided]),
        0.2 * log_odds(of_type[tracks, kind[decided]]),
        *(of_type[:, 0], of_type[tracks, same], of_type[tracks, other]),
        # Of the turn angles per tick.
        *(np.arcsinh(30.0 * angle) for angle in (mean, spread)),
        0.5 * (np.log(np.maximum(last.ticks, 1.0)) - 3.0),
        0.5 * (np.log1p(last.ticks_left) - 4.0),
        0.5 * (position + 2.0),
        xv / np.sqrt(np.maximum(xx * vv, 1e-300)),
        0.5 * (velocity + 6.0),
        0.3 * (noise + 5.0),
        0.5 * motion,
        0.5 * (process + 4.0),
        # A change over its deviation.
        np.arcsinh((speed - last.speed) / np.sqrt(np.maximum(variance, 1e-300))),
        np.arcsinh(last.bias[tracks, decided, 0]),
        np.arcsinh(last.bias[tracks, decided, 1]) * side,
        *(scales.follows_bank, scales.anchor_aware),
    ]
    return np.concatenate([clipped(columns), last.components.astype(np.float32)], axis=-1)


class RegretNet(nn.Module):
    """Loss of the next segment, which is 1 - reward, and how much of it a wrong turn causes."""

    def __init__(self, hidden: int):
        super().__init__()
        self.base = nn.Sequential(nn.Linear(CONTEXT, hidden), nn.Tanh(), nn.Linear(hidden, 1))
        self.excess = nn.Sequential(
            nn.Linear(CONTEXT + PAIR, hidden),
            nn.Tanh(),
            nn.Linear(hidden, hidden),
            nn.Tanh(),
            nn.Linear(hidden, 1),
        )

    def regret(self, context: Tensor, pair: Tensor, difference: Tensor) -> Tensor:
        """Return the expected increase of the loss (...) from inputs (..., 7), (..., 6) and (...).

        It is zero where the declared and the true turn do not differ.
        """
        # Below a difference of 1e-3 rad a tick a declaration costs little.
        share = 1.0 - torch.exp(-(difference / 1e-3).square())
        excess: Tensor = nn.functional.softplus(self.excess(torch.cat([context, pair], dim=-1)))
        return share * excess.squeeze(-1)

    def loss(self, context: Tensor, pair: Tensor, difference: Tensor, losses: Tensor) -> Tensor:
        """Return the mean squared error of the predicted losses (n,)."""
        predicted = self.base(context).squeeze(-1) + self.regret(context, pair, difference)
        return (predicted - losses).square().mean()


def regret_inputs(*values: FloatArray) -> tuple[Tensor, Tensor, Tensor]:
    """Return the inputs of the network, (..., 7), (..., 6) and (...), from seven arrays that
    broadcast to (...).

    They are the declared and the true turn angle per tick [rad], positive to the left, 0 for
    straight motion; `motion` and `process` of `ratios`; the ticks from the declaration to the
    switch; 1 or 0 for the options that the environment follows all filters, and that its bank is
    anchor-aware.
    """
    declared, true, motion, process, ticks_left, follows_bank, anchor_aware = np.broadcast_arrays(
        *values
    )
    difference = np.abs(declared - true)

    def log_turn(turn: FloatArray) -> FloatArray:
        return np.where(turn == 0.0, 0.0, 0.5 * (_log(np.abs(turn)) + 3.0))

    log_difference = np.log(np.maximum(difference, 1e-6))
    context = [
        log_turn(true),
        (true == 0.0).astype(np.float64),
        0.5 * motion,
        0.5 * (process + 4.0),
        0.5 * (np.log1p(ticks_left) - 4.0),
        follows_bank,
        anchor_aware,
    ]
    pair = [
        log_turn(declared),
        (declared == 0.0).astype(np.float64),
        np.sign(declared) * np.sign(true),
        0.5 * (log_difference + 4.0),
        0.5 * (log_difference + motion + 4.0),
        0.5 * (log_difference + motion + np.log1p(ticks_left)),
    ]
    of_context, of_pair = (torch.from_numpy(clipped(columns)) for columns in (context, pair))
    return of_context, of_pair, torch.from_numpy(difference.astype(np.float32))


class AnchorNet(nn.Module):
    """Mixture of normal distributions of the anchor error, relative to the covariance that the
    bank states.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.inputs = 22 + COMPONENTS
        self.layers = nn.Sequential(
            nn.Linear(self.inputs, hidden),
            nn.Tanh(),
            nn.Linear(hidden, hidden),
            nn.Tanh(),
        )
        self.output = zero_layer(hidden, COMPONENTS * NUMBERS)
        bias = torch.zeros(COMPONENTS, NUMBERS)
        bias[:, 0] = torch.tensor((0.0, -1.0, -3.0, -5.0))
        # Of the standard deviations, relative to those that the bank states.
        bias[:, 5:9] = torch.tensor((0.0, 1.2, 2.4, 3.6))[:, None]
        with torch.no_grad():
            self.output.bias.copy_(bias.flatten())

    def forward(self, inputs: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return log weights (n, C), means (n, C, 4) and Cholesky factors (n, C, 4, 4) of the
        covariances.

        The inputs are (n, 22 + C), see `anchor_inputs`.
        """
        numbers = self.output(self.layers(inputs)).unflatten(-1, (COMPONENTS, NUMBERS))
        scale = numbers[..., 5:9].clamp(-6.0, 9.0).exp()
        factor = torch.diag_embed(torch.ones_like(scale))
        factor[..., LOWER[0], LOWER[1]] = numbers[..., 9:]
        return (
            torch.log_softmax(numbers[..., 0], dim=-1),
            scale * numbers[..., 1:5],
            scale[..., None] * factor,
        )

    def loss(self, inputs: Tensor, errors: Tensor) -> Tensor:
        """Return the mean negative log-density of whitened errors, (n, 4)."""
        log_weight, mean, factor = self(inputs)
        white = torch.linalg.solve_triangular(
            factor,
            (errors[:, None] - mean)[..., None],
            upper=False,
        )
        log_determinant = factor.diagonal(dim1=-2, dim2=-1).log().sum(-1)
        log_density = (
            -0.5 * white[..., 0].square().sum(-1) - log_determinant - 2.0 * math.log(2.0 * math.pi)
        )
        return -torch.logsumexp(log_weight + log_density, dim=-1).mean()

    @torch.no_grad()
    def anchors(
        self,
        inputs: Float32Array,
        whitener: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return log weights (n, C), mean errors (n, C, 4) and covariances (n, C, 4, 4) in the
        heading frame.

        The inputs are as in `forward`, and the whitener (n, 4, 4) is that of `stated_factor`.
        """
        log_weight, mean, factor = (
            part.double().numpy() for part in self(torch.from_numpy(inputs))
        )
        root = whitener[:, None] @ factor
        return (
            log_weight,
            (whitener[:, None] @ mean[..., None])[..., 0],
            root @ root.swapaxes(-1, -2),
        )


def stated_factor(
    layout: Layout,
    rows: Observations,
    tau: FloatArray,
    side: FloatArray,
) -> FloatArray:
    """Return a factor F with F F' = stated covariance in the mirrored frame, (n, 4, 4), at the
    first row of a segment.

    The tick `tau` [s] and the side of the turn, 1 or -1, see `declared_side`, are (n,).
    """
    covariance = stated_covariance(layout, rows)
    noise = np.exp(layout.read(rows, "log_noise"))
    # Relative to R, and to R / tau^2 of the thousandth part.
    for k, floor in (
        (0, 1e-3 * noise),
        (1, 1e-3 * noise / (1000.0 * tau**2)),
    ):
        for axis in (k, k + 2):
            covariance[:, axis, axis] = np.maximum(covariance[:, axis, axis], floor)
    limit = 0.99 * np.sqrt(covariance[:, 0, 0] * covariance[:, 1, 1])
    for i, j in ((0, 1), (1, 0), (2, 3), (3, 2)):
        covariance[:, i, j] = np.clip(covariance[:, i, j], -limit, limit)
    signs = np.where(side[:, None] < 0, MIRROR, 1.0)
    return np.asarray(signs[..., None] * np.linalg.cholesky(covariance))
