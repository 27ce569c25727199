"""The bank of Kalman filters, one per hypothesis: straight, left turns, right turns.

Golubkov 2018, eq. (2) and (4). Process and measurement noise are diagonal, so the 4x4 filter of the paper
is two filters (position, velocity), one an axis. Their covariances do not depend on the data, only on the
turn rate, so a left and a right turn of one radius share them, and so do the axes where the measurement
noise is equal on both. What is left per hypothesis is four numbers of state, the two of its centre and one
log-likelihood.

Every field holds one number a lane. Hypothesis 0 is straight, 1 .. n turn left, n + 1 .. 2n turn right.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import formula, internal
from hybrid_env.core.elementary import log
from hybrid_env.core.in_place import in_place, prefetch
from hybrid_env.core.instructions import span
from hybrid_env.core.memory import aligned_zeros
from hybrid_env.core.motion import heading_vector, motion_coefficients, propagate, turn_centre
from hybrid_env.core.records import lanes_of

FloatArray = NDArray[np.float64]
Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]

HYPOTHESIS = lanes_of(
    *((name, np.float64, ()) for name in ("x", "vx", "y", "vy")),  # estimate [m, m/s]
    *((name, np.float64, ()) for name in ("centre_x", "centre_y")),  # of the turn [m]
    ("log_likelihood", np.float64, ()),  # cumulative since the switch
)
"""One filter of the bank."""

COVARIANCE = lanes_of(
    *((name, np.float64, ()) for name in ("cosine", "sine_velocity", "sine_position")),  # of the transition
    *((name, np.float64, ()) for name in ("xx", "xv", "vv")),  # of (position, velocity) [m^2, m^2/s, m^2/s^2]
)
"""What the filters of one radius share on one axis."""

INNOVATION = lanes_of(
    *((name, np.float64, ()) for name in ("white_x", "white_y")),  # over its standard deviation
    ("log_variance", np.float64, ()),  # mean of the axes, of m^2
)
"""What one filter found at this tick."""

GAIN = lanes_of(
    *((name, np.float64, ()) for name in ("cosine", "sine_velocity", "sine_position")),  # as in `COVARIANCE`
    *((name, np.float64, ()) for name in ("gain_x", "gain_v")),  # of position and velocity
    ("whitener", np.float64, ()),  # 1 / standard deviation of the innovation [1/m]
    ("log_variance", np.float64, ()),  # of the innovation
)
"""What the filters of one radius share on one axis at this tick: all that `step_estimate` reads."""


class Bank(NamedTuple):
    """The bank of a block of tracks, for M = 2n + 1 hypotheses of n radii and A = 1 or 2 noise axes.

    Attributes:
        hypotheses: (M,) records `HYPOTHESIS`.
        covariances: (A, n + 1) records `COVARIANCE`; column 0 is straight, column c has radius c - 1.
        innovations: (M,) records `INNOVATION` of the last tick, which the banks of other blocks overwrite.
        gains: (A, n + 1) records `GAIN`, likewise.
    """

    hypotheses: NDArray[Any]
    covariances: NDArray[Any]
    innovations: NDArray[Any]
    gains: NDArray[Any]


LOG_TWO_PI = math.log(2.0 * math.pi)
IDENTITY = (1.0, 0.0, 1.0)
"""P := I of the published algorithms (Tsyganov 2019, line 28; Golubkov 2018, setFilters)."""


@internal
def mode_type(mode: int, radii_count: int) -> int:
    """0 straight, 1 left, 2 right."""
    return 0 if mode == 0 else (1 if mode <= radii_count else 2)


@internal
def radius_column(hypothesis: int, radii_count: int) -> int:
    """Column of `covariances` and `gains` that a hypothesis uses."""
    return hypothesis - radii_count if hypothesis > radii_count else hypothesis


@internal
def anchor_bank(
    bank: Bank,
    lane: int,
    anchor: Quadruple,
    radii: FloatArray,
    tau: float,
    covariance_x: Triple,
    covariance_y: Triple,
) -> None:
    """Start every hypothesis of a lane at one estimate, its turn rate and centre computed from that.

    Args:
        anchor: estimate [x, vx, y, vy] at the switch [m, m/s].
        radii: (n,) turn radii of the bank [m].
        tau: tick [s].
        covariance_x, covariance_y: starting covariance on each axis, (xx, xv, vv).
    """
    n = radii.size
    speed, heading_x, heading_y = heading_vector(anchor[1], anchor[3])
    for c in span(0, n + 1):
        turn_rate = 0.0 if c == 0 else speed / radii[c - 1]
        cosine, sine_velocity, sine_position = motion_coefficients(turn_rate, tau)
        for axis in span(0, bank.covariances.shape[0]):
            one = in_place(bank.covariances[axis, c])
            one.cosine[lane], one.sine_velocity[lane], one.sine_position[lane] = (
                cosine, sine_velocity, sine_position,
            )  # fmt: skip
            covariance = covariance_x if axis == 0 else covariance_y
            one.xx[lane], one.xv[lane], one.vv[lane] = covariance
    for h in span(0, 2 * n + 1):
        kalman = in_place(bank.hypotheses[h])
        kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane] = anchor
        kalman.log_likelihood[lane] = 0.0
        radius = 0.0
        if h > n:
            radius = -radii[h - n - 1]
        elif h > 0:
            radius = radii[h - 1]
        kalman.centre_x[lane], kalman.centre_y[lane] = turn_centre(
            anchor[0], anchor[2], heading_x, heading_y, radius
        )


@internal
def rewind(bank: Bank, lane: int, hypothesis: int, anchor: Quadruple) -> None:
    """Put one hypothesis back to an estimate and leave its covariance. Tsyganov 2019, lines 17 to 20."""
    kalman = in_place(bank.hypotheses[hypothesis])
    kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane] = anchor


@formula
def step_covariance(
    one: Any, gain: Any, lane: int, process_variance: float, variance: float
) -> tuple[float, float]:
    """Covariance and gain of one radius over one tick. Golubkov 2018, eq. (2); Sigma = H P H' + R.

    Returns the innovation's variance and its inverse.
    """
    cosine, sine_velocity, sine_position = one.cosine[lane], one.sine_velocity[lane], one.sine_position[lane]
    xx, xv, vv = one.xx[lane], one.xv[lane], one.vv[lane]
    row_x_x = cosine * xx + sine_velocity * xv  # first row of Phi P
    row_x_v = cosine * xv + sine_velocity * vv
    row_v_x = cosine * xv - sine_position * xx  # second row of Phi P
    row_v_v = cosine * vv - sine_position * xv
    xx = cosine * row_x_x + sine_velocity * row_x_v
    xv = cosine * row_x_v - sine_position * row_x_x
    vv = cosine * row_v_v - sine_position * row_v_x + process_variance
    innovation_variance = xx + variance
    inverse = 1.0 / innovation_variance
    gain_x = xx * inverse
    gain_v = xv * inverse
    one.xx[lane] = gain_x * variance  # P - K H P, without its cancellation
    one.xv[lane] = gain_v * variance
    one.vv[lane] = vv - gain_v * xv
    gain.cosine[lane], gain.sine_velocity[lane], gain.sine_position[lane] = (
        cosine, sine_velocity, sine_position,
    )  # fmt: skip
    gain.gain_x[lane], gain.gain_v[lane] = gain_x, gain_v
    return innovation_variance, inverse


@formula
def step_estimate(
    kalman: Any, gain_x: Any, gain_y: Any, lane: int, measurement_x: float, measurement_y: float
) -> tuple[float, float]:
    """Predict, compare with the measurement, correct. Golubkov 2018, eq. (2). Returns the innovation [m]."""
    cosine = gain_x.cosine[lane]
    sine_velocity = gain_x.sine_velocity[lane]
    sine_position = gain_x.sine_position[lane]
    x, vx = propagate(
        kalman.x[lane], kalman.vx[lane], kalman.centre_x[lane], cosine, sine_velocity, sine_position
    )
    y, vy = propagate(
        kalman.y[lane], kalman.vy[lane], kalman.centre_y[lane], cosine, sine_velocity, sine_position
    )
    innovation_x = measurement_x - x
    innovation_y = measurement_y - y
    kalman.x[lane] = x + gain_x.gain_x[lane] * innovation_x
    kalman.vx[lane] = vx + gain_x.gain_v[lane] * innovation_x
    kalman.y[lane] = y + gain_y.gain_x[lane] * innovation_y
    kalman.vy[lane] = vy + gain_y.gain_v[lane] * innovation_y
    return innovation_x, innovation_y


@internal
def step_bank(
    bank: Bank,
    first: int,
    last: int,
    measurement: FloatArray,
    process_variance: float,
    variance_x: float,
    variance_y: float,
) -> None:
    """One tick of every hypothesis, its log-likelihood included.

    The increment is ln N(innovation; 0, Sigma), whose differences are Golubkov 2018, eq. (4). While it works
    on one filter, it asks for that of the next block, which lies behind this one: state of many tracks has to
    come from far, and asked for at once it would be waited for.

    Args:
        first, last: lanes first .. last - 1 take the tick.
        measurement: (2, LANES) [m].
        process_variance: Q [m^2/s^2].
        variance_x, variance_y: R [m^2].
    """
    axes, columns = bank.covariances.shape
    for axis in span(0, axes):
        variance = variance_x if axis == 0 else variance_y
        for c in span(0, columns):
            one, gain = in_place(bank.covariances[axis, c]), in_place(bank.gains[axis, c])
            prefetch(one, bank.covariances.nbytes, COVARIANCE)
            for lane in span(first, last):
                innovation_variance, inverse = step_covariance(one, gain, lane, process_variance, variance)
                gain.whitener[lane] = math.sqrt(inverse)
                gain.log_variance[lane] = log(innovation_variance)
    for h in span(0, bank.hypotheses.size):
        kalman, innovation = in_place(bank.hypotheses[h]), in_place(bank.innovations[h])
        prefetch(kalman, bank.hypotheses.nbytes, HYPOTHESIS)
        column = radius_column(h, columns - 1)
        gain_x, gain_y = in_place(bank.gains[0, column]), in_place(bank.gains[axes - 1, column])
        for lane in span(first, last):
            innovation_x, innovation_y = step_estimate(
                kalman, gain_x, gain_y, lane, measurement[0, lane], measurement[1, lane]
            )
            white_x = innovation_x * gain_x.whitener[lane]
            white_y = innovation_y * gain_y.whitener[lane]
            log_variance = 0.5 * (gain_x.log_variance[lane] + gain_y.log_variance[lane])
            innovation.white_x[lane] = white_x
            innovation.white_y[lane] = white_y
            innovation.log_variance[lane] = log_variance
            kalman.log_likelihood[lane] -= (
                LOG_TWO_PI + log_variance + 0.5 * (white_x * white_x + white_y * white_y)
            )


@internal
def step_alone(
    bank: Bank,
    lane: int,
    hypothesis: int,
    measurement_x: float,
    measurement_y: float,
    process_variance: float,
    variance_x: float,
    variance_y: float,
) -> None:
    """One tick of one hypothesis of one lane, as after a decision: Golubkov 2018, algorithm 1, line 15.

    It is not compared any more: its log-likelihood stays.
    """
    axes, columns = bank.covariances.shape
    column = radius_column(hypothesis, columns - 1)
    for axis in span(0, axes):
        variance = variance_x if axis == 0 else variance_y
        one, gain = in_place(bank.covariances[axis, column]), in_place(bank.gains[axis, column])
        step_covariance(one, gain, lane, process_variance, variance)
    kalman = in_place(bank.hypotheses[hypothesis])
    gain_x, gain_y = in_place(bank.gains[0, column]), in_place(bank.gains[axes - 1, column])
    step_estimate(kalman, gain_x, gain_y, lane, measurement_x, measurement_y)


@internal
def likeliest(hypotheses: NDArray[Any], lane: int) -> int:
    """The hypothesis with the largest log-likelihood, the first of equals."""
    best, largest = 0, in_place(hypotheses[0]).log_likelihood[lane]
    for h in span(1, hypotheses.size):
        log_likelihood = in_place(hypotheses[h]).log_likelihood[lane]
        if log_likelihood > largest:
            best, largest = h, log_likelihood
    return best


@internal
def estimate_of(hypotheses: NDArray[Any], hypothesis: int, lane: int) -> Quadruple:
    """[x, vx, y, vy] of one hypothesis."""
    kalman = in_place(hypotheses[hypothesis])
    return kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]


@internal
def covariance_of(covariances: NDArray[Any], hypothesis: int, lane: int) -> tuple[Triple, Triple]:
    """(xx, xv, vv) of one hypothesis on each axis."""
    axes, columns = covariances.shape
    column = radius_column(hypothesis, columns - 1)
    x, y = in_place(covariances[0, column]), in_place(covariances[axes - 1, column])
    return (x.xx[lane], x.xv[lane], x.vv[lane]), (y.xx[lane], y.xv[lane], y.vv[lane])


def bank_arrays(radii_count: int, axes: int, *blocks: int) -> Bank:
    """A bank of zeros; with a number of blocks, what each block has of its own has that axis in front."""
    hypotheses = 2 * radii_count + 1
    columns = radii_count + 1
    return Bank(
        aligned_zeros((*blocks, hypotheses), HYPOTHESIS),
        aligned_zeros((*blocks, axes, columns), COVARIANCE),
        aligned_zeros((hypotheses,), INNOVATION),
        aligned_zeros((axes, columns), GAIN),
    )
