"""Inputs of the networks of the anchor agent, without units.

Lengths are divided by the standard deviation of a measurement or by the distance per tick, times by
the tick. Lateral quantities are mirrored to the side of the declared turn, so that a mirrored
trajectory gives the same inputs.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from baselines.rules.component_filters import stated_covariance
from baselines.rules.decider import Observations
from hybrid_env.checks import Float32Array, FloatArray, IntArray
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions


def bounded_log(values: ArrayLike, smallest: float = 1e-12) -> FloatArray:
    """Return the logarithms of values, of at least the smallest one."""
    return np.asarray(np.log(np.maximum(values, smallest)))


def log_odds(probability: ArrayLike, smallest: float = 1e-12) -> FloatArray:
    """Return the log-odds of probabilities, at least the smallest one away from 0 and 1."""
    inside = np.clip(probability, smallest, 1.0 - smallest)
    return np.asarray(np.log(inside) - np.log1p(-inside))


def clipped(columns: Sequence[ArrayLike]) -> Float32Array:
    """Return inputs (..., K) within their limits from columns that broadcast to (...)."""
    return np.clip(np.stack(np.broadcast_arrays(*columns), -1), -5.0, 5.0).astype(np.float32)


class RowRatios:
    """Quantities of N rows of an environment in which modes are declared, without units.

    Attributes:
        turn: (N, M) turn angle per tick of each hypothesis at the speed of the anchor [rad].
        motion: (N,) logarithm of the distance per tick / sqrt(R).
        process: (N,) of sqrt(Q) / speed.
        noise: (N,) of sqrt(Q) / sqrt(R) per tick.
        position, velocity: (N,) of the variances of the anchor over R.
        of_world: 1 or 0 for options of the environment: it follows all filters, and its bank is
            anchor-aware.
    """

    def __init__(self, world: WorldOptions, rows: Observations):
        self.world, self.rows, self.layout = world, rows, Layout(world.hypotheses)
        self.kind = world.types
        self.of_world = float(world.follow == "bank"), float(world.bank == "anchor_aware")
        self.turn = self.read("turn_angle")
        # Process noise of the velocity, in sqrt(R) per tick.
        self.process_deviation = np.sqrt(world.process_variance) * world.tau / world.deviation
        self.motion = bounded_log(self.read("speed"))
        self.noise = bounded_log(self.process_deviation, 1e-150)
        self.process = self.noise - self.motion
        self.position = bounded_log(self.read("anchor_xx"))
        self.velocity = bounded_log(self.read("anchor_vv"), 1e-150)

    def read(self, name: str) -> FloatArray:
        """Return a quantity of the rows, see `Layout.read`."""
        return self.layout.read(self.rows, name)

    def of_mode(self, values: FloatArray, modes: IntArray) -> FloatArray:
        """Return the values (N, M, ...) of one mode of each row, (N, ...)."""
        return values[np.arange(len(modes)), modes]

    def within_type(self, posterior: FloatArray, modes: IntArray) -> FloatArray:
        """Return the posterior (N, M) of the hypotheses of the type of each mode (N,), given this
        type.
        """
        within = np.where(self.kind == self.kind[modes][:, None], posterior, 0.0)
        return within / np.maximum(within.sum(-1, keepdims=True), 1e-12)


def log_turn(turn: FloatArray) -> FloatArray:
    """Return an input for turn angles per tick (...), 0 for straight motion."""
    return np.where(turn == 0.0, 0.0, 0.5 * (bounded_log(np.abs(turn)) + 3.0))


def declared_side(ratios: RowRatios, posterior: FloatArray) -> FloatArray:
    """Return the side of the turn that the anchor follows, (N,): 1 left, -1 right.

    After a straight segment it is the side with the larger posterior (N, M) before the switch.
    """
    decided = ratios.kind[ratios.read("previous").argmax(-1)]
    left, right = (posterior[:, ratios.kind == motion_type].sum(-1) for motion_type in (1, 2))
    return np.where(np.where(decided == 0, left >= right, decided == 1), 1.0, -1.0)


def anchor_inputs(
    ratios: RowRatios,
    side: FloatArray,
    posterior: FloatArray,
    components: FloatArray,
    bias: FloatArray,
    before: FloatArray,
) -> Float32Array:
    """Return the inputs for the distribution of the anchor error, (N, 22 + C), at first rows of
    a segment.

    Args:
        ratios: of the rows.
        side: (N,) of `declared_side`.
        posterior: (N, M) of the hypotheses before the switch.
        components: (N, C) posterior of the components of the last anchor, the last C inputs.
        bias: (N, M, 2) see `bias_of_bank`, before the switch.
        before: (N, 3) ticks, ticks left and speed of the row before the switch.
    """
    read = ratios.read
    kind = ratios.kind
    decided = read("previous").argmax(-1)
    ticks, ticks_left, last_speed = before.T
    of_type = np.stack([posterior[:, kind == k].sum(-1) for k in range(3)], axis=-1)
    same = np.where(side > 0, 1, 2)
    turn = ratios.turn * side[:, None]
    declared = ratios.of_mode(turn, decided)
    deviation = turn - declared[:, None]
    within = ratios.within_type(posterior, decided)
    mean = (within * deviation).sum(-1)
    spread = np.sqrt((within * deviation**2).sum(-1))
    xx, xv, vv = (read(name) for name in ("anchor_xx", "anchor_xv", "anchor_vv"))
    # Variance of the speed.
    variance = vv + ratios.process_deviation**2 * (ticks + ticks_left)
    drift = ratios.of_mode(bias, decided)
    columns = [
        log_turn(declared),
        decided == 0,
        0.2 * log_odds(ratios.of_mode(posterior, decided)),
        0.2 * log_odds(ratios.of_mode(of_type, kind[decided])),
        of_type[:, 0],
        ratios.of_mode(of_type, same),
        ratios.of_mode(of_type, 3 - same),
        # Mean and spread of the turn angles per tick.
        np.arcsinh(30.0 * mean),
        np.arcsinh(30.0 * spread),
        0.5 * (np.log(np.maximum(ticks, 1.0)) - 3.0),
        0.5 * (np.log1p(ticks_left) - 4.0),
        0.5 * (ratios.position + 2.0),
        xv / np.sqrt(np.maximum(xx * vv, 1e-300)),
        0.5 * (ratios.velocity + 6.0),
        0.3 * (ratios.noise + 5.0),
        0.5 * ratios.motion,
        0.5 * (ratios.process + 4.0),
        # A change over its deviation.
        np.arcsinh((read("speed") - last_speed) / np.sqrt(np.maximum(variance, 1e-300))),
        np.arcsinh(drift[:, 0]),
        np.arcsinh(drift[:, 1]) * side,
        *ratios.of_world,
    ]
    return np.concatenate([clipped(columns), components.astype(np.float32)], axis=-1)


def bias_of_bank(ratios: RowRatios, innovations: FloatArray) -> FloatArray:
    """Return the innovations of the bank minus those of the agent's filters (N, M, 3), see
    `ComponentFilters`, over sqrt(R), (N, M, 2).

    The difference, along and across the heading, is that of the predicted positions: how far the
    filter of the bank has drifted.
    """
    deviation = np.exp(0.5 * ratios.read("log_variance"))[..., None]
    names = ("innovation_along", "innovation_across")
    of_bank = np.stack([ratios.read(name) for name in names], axis=-1) * deviation
    deviation = np.exp(0.5 * innovations[..., 2:]) / ratios.world.deviation
    return of_bank - innovations[..., :2] * deviation


def regret_inputs(ratios: RowRatios, declared: FloatArray, true: FloatArray) -> Float32Array:
    """Return the inputs for the cost of a declaration in the next segment, (N, K, 14).

    The first 7 do not depend on the declaration, and the last one is the difference of both turns.
    Declared and true turn angles per tick [rad], (N, 1) or (N, K), are positive to the left, 0 for
    straight motion.
    """
    motion, process, ticks_left = (
        values[:, None] for values in (ratios.motion, ratios.process, ratios.read("ticks_left"))
    )
    difference = np.abs(declared - true)
    log_difference = bounded_log(difference, 1e-6)
    return clipped(
        [
            log_turn(true),
            true == 0.0,
            0.5 * motion,
            0.5 * (process + 4.0),
            0.5 * (np.log1p(ticks_left) - 4.0),
            *ratios.of_world,
            log_turn(declared),
            declared == 0.0,
            np.sign(declared) * np.sign(true),
            0.5 * (log_difference + 4.0),
            0.5 * (log_difference + motion + 4.0),
            0.5 * (log_difference + motion + np.log1p(ticks_left)),
            difference,
        ]
    )


def stopping_inputs(
    ratios: RowRatios,
    posterior: FloatArray,
    error: FloatArray,
    best: IntArray,
    changes: FloatArray,
    squares: FloatArray,
    heavy_tails: FloatArray,
) -> Float32Array:
    """Return the inputs for the decision to declare, (N, 31).

    Args:
        ratios: of the rows.
        posterior: (N, M) of the hypotheses.
        error: (N,) error probability of the best declaration.
        best: (N,) its hypothesis.
        changes: (N, 3) of the log-odds of this declaration to be right, since moving averages of
            different length.
        squares: (N, 2) moving averages of the squared whitened innovation over 2: since the
            switch, and since the first one.
        heavy_tails: (N,) probability of heavy tails.
    """
    world = ratios.world
    groups = world.groups
    ticks, left = (ratios.read(name) for name in ("ticks", "ticks_left"))
    rival = np.where(groups == groups[best][:, None], -1.0, posterior).argmax(-1)
    turn = ratios.turn
    deviation = turn - ratios.of_mode(turn, best)[:, None]
    difference = bounded_log(np.abs(ratios.of_mode(deviation, rival)), 1e-6)
    spread = np.sqrt((ratios.within_type(posterior, best) * deviation**2).sum(-1))
    cost = bounded_log(world.delay_cost, 1e-9) - np.log(0.02)
    log_ticks = np.log(np.maximum(ticks, 1.0))
    # Logarithm of the distance to the rival over sqrt(R), per squared tick.
    separation = difference + ratios.motion
    return clipped(
        [
            -log_odds(error, 1e-9) / 4.0,
            *(changes / 2.0).T,
            log_ticks - 2.5,
            ticks / 40.0 - 0.5,
            0.5 * (np.log1p(left) - 3.0),
            0.5 * (np.log1p(left) + cost - 3.0),
            *np.log(squares).T,
            heavy_tails,
            0.5 * (difference + 3.0),
            0.5 * (separation + 2.0 * log_ticks - 3.0),
            0.5 * (separation + 2.0 * np.log(ticks + 10.0) - 5.0),
            bounded_log(ratios.of_mode(posterior, rival), 1e-9) / 4.0,
            np.arcsinh(30.0 * spread),
            np.arcsinh(30.0 * spread * np.sqrt(np.maximum(left, 0.0))) / 2.0,
            -(posterior * bounded_log(posterior, 1e-9)).sum(-1),
            best == 0,
            rival == 0,
            0.5 * ratios.motion,
            0.5 * (ratios.process + 4.0),
            0.3 * (ratios.noise + 5.0),
            0.5 * (ratios.position + 2.0),
            0.5 * (ratios.velocity + 6.0),
            *ratios.of_world,
            cost / 2.0,
            world.correctness == "type",
            np.log(world.hypotheses / 3.0) / 2.0,
            np.log(world.decide_every),
        ]
    )


def stated_factor(ratios: RowRatios, side: FloatArray) -> FloatArray:
    """Return a factor F with F F' = stated covariance in the mirrored frame, (N, 4, 4), at first
    rows of a segment; the side of the turn (N,) is 1 or -1, see `declared_side`.
    """
    covariance = stated_covariance(ratios.world, ratios.rows)
    # Relative to R, and to R / tau^2 of the thousandth part.
    position = 1e-3 * ratios.world.deviation**2
    velocity = position / (1000.0 * ratios.world.tau**2)
    for k, floor in enumerate((position, velocity, position, velocity)):
        covariance[:, k, k] = np.maximum(covariance[:, k, k], floor)
    limit = 0.99 * np.sqrt(covariance[:, 0, 0] * covariance[:, 1, 1])
    for i, j in ((0, 1), (1, 0), (2, 3), (3, 2)):
        covariance[:, i, j] = np.clip(covariance[:, i, j], -limit, limit)
    # Signs of [x, vx, y, vy] in a frame whose across axis points to the side of the turn.
    signs = np.where(side[:, None] < 0, [1.0, 1.0, -1.0, -1.0], 1.0)
    return np.asarray(signs[..., None] * np.linalg.cholesky(covariance))
