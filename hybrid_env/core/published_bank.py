"""The published bank of Kalman filters, one per hypothesis: straight, left turns, right turns.

Golubkov 2018, eq. (2) and (4), with the scalar formulas of `kalman`. The covariances depend on the turn rate
but not on the data. The left and the right turn of a radius therefore share them, and so do both axes if
their measurement variances are equal. Each hypothesis has its four state estimates, the centre of its turn
and its log-likelihood.

Hypothesis 0 is straight, 1 .. n are left turns, n + 1 .. 2n are right turns. Every field has one value per
lane.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.elementary import log
from hybrid_env.core.kalman import (
    correct_covariance,
    kalman_gain,
    log_likelihood,
    predict_covariance,
)
from hybrid_env.core.memory import aligned_zeros, array_at
from hybrid_env.core.motion import bank_turn_rate, heading_vector, motion_coefficients, propagate, turn_centre
from hybrid_env.core.records import lanes_of

FloatArray = NDArray[np.float64]
State = tuple[float, float, float, float]
Triangle4 = tuple[float, float, float, float, float, float, float, float, float, float]
"""Covariance of [x, vx, y, vy], upper triangle row by row."""

HYPOTHESIS = lanes_of(
    *((name, np.float64, ()) for name in ("x", "vx", "y", "vy")),  # estimate [m, m/s]
    *((name, np.float64, ()) for name in ("centre_x", "centre_y")),  # of the turn [m]
    ("log_likelihood", np.float64, ()),  # cumulative since the switch
)
"""State of one filter."""

COVARIANCE = lanes_of(
    *((name, np.float64, ()) for name in ("cosine", "sine_velocity", "sine_position")),  # of the transition
    *((name, np.float64, ()) for name in ("xx", "xv", "vv")),  # of (position, velocity) [m^2, m^2/s, m^2/s^2]
)
"""Transition and covariance on one axis, shared by the filters of one radius."""

INNOVATION = lanes_of(
    *((name, np.float64, ()) for name in ("white_x", "white_y")),  # innovation / standard deviation
    ("log_variance", np.float64, ()),  # ln of the innovation variance [m^2], mean of the axes
)
"""Innovation of one filter at the current tick."""

GAIN = lanes_of(
    *((name, np.float64, ()) for name in ("gain_x", "gain_v")),  # of position and velocity
    ("whitener", np.float64, ()),  # 1 / standard deviation of the innovation [1/m]
    ("log_variance", np.float64, ()),  # ln of the innovation variance [m^2]
)
"""Gain and innovation variance on one axis at the current tick, shared by the filters of one radius."""


class PublishedBank(NamedTuple):
    """The bank of a block of tracks, for n radii, M = 2n + 1 hypotheses and A = 1 or 2 distinct axes.

    Attributes:
        hypotheses: (M,) records `HYPOTHESIS`.
        covariances: (A, n + 1) records `COVARIANCE`; column 0 is straight, column c uses radius c - 1.
        innovations: (M,) records `INNOVATION`, temporary memory shared by the blocks of a thread.
        gains: (A, n + 1) records `GAIN`, temporary memory shared by the blocks of a thread.
    """

    hypotheses: NDArray[Any]
    covariances: NDArray[Any]
    innovations: NDArray[Any]
    gains: NDArray[Any]


class FilterModel(NamedTuple):
    """The model assumed by the filters. `records.PARAMETERS` has the same fields.

    Attributes:
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2].
        variance_x, variance_y: R of each axis [m^2].
        freedom: degrees of freedom of a Student t likelihood, see `student_bank`.
    """

    tau: float
    process_variance: float
    variance_x: float
    variance_y: float
    freedom: float = 0.0


IDENTITY: Triangle4 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
"""P := I, as in the published algorithms (Tsyganov 2019, line 28; Golubkov 2018, setFilters)."""


@inlined
def published_banks(setting: Any) -> PublishedBank:
    """Return the banks of all blocks from the addresses in a record `records.PARAMETERS`."""
    n, axes, blocks = setting.radii_count, setting.axes, setting.blocks_count
    return PublishedBank(
        array_at(setting.hypotheses, (blocks, 2 * n + 1), HYPOTHESIS),
        array_at(setting.covariances, (blocks, axes, n + 1), COVARIANCE),
        array_at(setting.innovations, (2 * n + 1,), INNOVATION),
        array_at(setting.gains, (axes, n + 1), GAIN),
    )


@internal
def published_of_block(banks: PublishedBank, block: int) -> PublishedBank:
    """Return the bank of one block."""
    return PublishedBank(banks.hypotheses[block], banks.covariances[block], banks.innovations, banks.gains)


def published_arrays(radii_count: int, axes: int, *blocks: int) -> PublishedBank:
    """Return a bank of zeros. `blocks` is prepended to the shape of arrays that are not shared by blocks."""
    hypotheses = 2 * radii_count + 1
    columns = radii_count + 1
    return PublishedBank(
        aligned_zeros((*blocks, hypotheses), HYPOTHESIS),
        aligned_zeros((*blocks, axes, columns), COVARIANCE),
        aligned_zeros((hypotheses,), INNOVATION),
        aligned_zeros((axes, columns), GAIN),
    )


@internal
def mode_type(mode: int, radii_count: int) -> int:
    """Return the type of a mode: 0 straight, 1 left, 2 right."""
    return 0 if mode == 0 else (1 if mode <= radii_count else 2)


@internal
def signed_radius(hypothesis: int, radii: FloatArray) -> float:
    """Return the radius of a hypothesis [m], positive to the left, negative to the right, 0 if straight."""
    if hypothesis == 0:
        return 0.0
    return radii[hypothesis - 1] if hypothesis <= radii.size else -radii[hypothesis - radii.size - 1]


@internal
def radius_column(hypothesis: int, radii_count: int) -> int:
    """Return the column of `covariances` and `gains` of a hypothesis."""
    return hypothesis - radii_count if hypothesis > radii_count else hypothesis


@internal
def begin_published(
    bank: PublishedBank, lane: int, anchor: State, covariance: Triangle4, radii: FloatArray, model: Any
) -> None:
    """Start every filter of a lane from the anchor, which also determines turn rates and centres.

    Args:
        bank: bank of the block.
        lane: index of the track in the block.
        anchor: estimate [x, vx, y, vy] at the switch [m, m/s].
        covariance: covariance of the anchor, upper triangle row by row; covariances between the axes are
            ignored.
        radii: (n,) turn radii of the bank [m].
        model: a `FilterModel`, or a record with its fields.
    """
    x, vx, y, vy = anchor
    speed, heading_x, heading_y = heading_vector(vx, vy)
    for column in range(radii.size + 1):
        turn_rate = 0.0 if column == 0 else bank_turn_rate(speed, radii[column - 1], model.tau)
        cosine, sine_velocity, sine_position = motion_coefficients(turn_rate, model.tau)
        for axis in range(bank.covariances.shape[0]):
            shared = bank.covariances[axis, column]
            shared.cosine[lane] = cosine
            shared.sine_velocity[lane] = sine_velocity
            shared.sine_position[lane] = sine_position
            shared.xx[lane] = covariance[0] if axis == 0 else covariance[7]
            shared.xv[lane] = covariance[1] if axis == 0 else covariance[8]
            shared.vv[lane] = covariance[4] if axis == 0 else covariance[9]
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        set_estimate(kalman, lane, anchor)
        kalman.log_likelihood[lane] = 0.0
        centre_x, centre_y = turn_centre(x, y, heading_x, heading_y, signed_radius(h, radii))
        kalman.centre_x[lane], kalman.centre_y[lane] = centre_x, centre_y


@internal
def set_estimate(kalman: Any, lane: int, estimate: State) -> None:
    """Set the estimate [x, vx, y, vy] of a filter without its covariance and centre."""
    kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane] = estimate


@inlined
def _step_covariance(shared: Any, gain: Any, lane: int, process_variance: float, variance: float) -> float:
    """Update the covariance and gain of one radius and axis. Returns the innovation variance [m^2]."""
    covariance = predict_covariance(
        (shared.xx[lane], shared.xv[lane], shared.vv[lane]),
        shared.cosine[lane], shared.sine_velocity[lane], shared.sine_position[lane], process_variance,
    )  # fmt: skip
    innovation_variance = covariance[0] + variance  # Sigma = H P H' + R
    gain_x, gain_v = kalman_gain(covariance, innovation_variance)
    xx, xv, vv = correct_covariance(covariance, gain_x, gain_v, variance)
    shared.xx[lane], shared.xv[lane], shared.vv[lane] = xx, xv, vv
    gain.gain_x[lane], gain.gain_v[lane] = gain_x, gain_v
    return innovation_variance


@inlined
def predict_estimate(kalman: Any, shared: Any, lane: int) -> State:
    """Return the predicted estimate [x, vx, y, vy] of a filter. Golubkov 2018, eq. (2)."""
    cosine, sine_velocity, sine_position = (
        shared.cosine[lane], shared.sine_velocity[lane], shared.sine_position[lane],
    )  # fmt: skip
    x, vx = propagate(
        kalman.x[lane], kalman.vx[lane], kalman.centre_x[lane], cosine, sine_velocity, sine_position
    )
    y, vy = propagate(
        kalman.y[lane], kalman.vy[lane], kalman.centre_y[lane], cosine, sine_velocity, sine_position
    )
    return x, vx, y, vy


@inlined
def _step_estimate(
    kalman: Any, shared: Any, gain_x: Any, gain_y: Any, lane: int, measured_x: float, measured_y: float
) -> tuple[float, float]:
    """Predict and correct the estimate of a filter. Golubkov 2018, eq. (2). Returns the innovation [m]."""
    x, vx, y, vy = predict_estimate(kalman, shared, lane)
    innovation_x, innovation_y = measured_x - x, measured_y - y
    correct_estimate(kalman, (x, vx, y, vy), gain_x, gain_y, lane, innovation_x, innovation_y)
    return innovation_x, innovation_y


@inlined
def correct_estimate(
    kalman: Any,
    predicted: State,
    gain_x: Any,
    gain_y: Any,
    lane: int,
    correction_x: float,
    correction_y: float,
) -> None:
    """Correct the predicted estimate of a filter by an innovation, which may be weighted [m]."""
    x, vx, y, vy = predicted
    kalman.x[lane] = x + gain_x.gain_x[lane] * correction_x
    kalman.vx[lane] = vx + gain_x.gain_v[lane] * correction_x
    kalman.y[lane] = y + gain_y.gain_x[lane] * correction_y
    kalman.vy[lane] = vy + gain_y.gain_v[lane] * correction_y


@inlined
def step_covariances(bank: Any, first: int, last: int, model: Any) -> None:
    """Update covariances, gains and innovation variances of all radii; arguments as in `step_published`."""
    axes, columns = bank.covariances.shape
    for axis in range(axes):
        variance = model.variance_x if axis == 0 else model.variance_y
        for column in range(columns):
            shared, gain = bank.covariances[axis, column], bank.gains[axis, column]
            for lane in range(first, last):
                innovation_variance = _step_covariance(shared, gain, lane, model.process_variance, variance)
                gain.whitener[lane] = math.sqrt(1.0 / innovation_variance)
                gain.log_variance[lane] = log(innovation_variance)


@internal
def step_published(bank: PublishedBank, first: int, last: int, measurement: FloatArray, model: Any) -> None:
    """Advance every filter and its log-likelihood by one tick. Golubkov 2018, eq. (2) and (4).

    Args:
        bank: bank of the block.
        first, last: range of lanes, first .. last - 1.
        measurement: (2, LANES) [m].
        model: a `FilterModel`, or a record with its fields.
    """
    axes, columns = bank.covariances.shape
    step_covariances(bank, first, last, model)
    for h in range(bank.hypotheses.size):
        kalman, innovation = bank.hypotheses[h], bank.innovations[h]
        column = radius_column(h, columns - 1)
        shared = bank.covariances[0, column]
        gain_x, gain_y = bank.gains[0, column], bank.gains[axes - 1, column]
        for lane in range(first, last):
            innovation_x, innovation_y = _step_estimate(
                kalman, shared, gain_x, gain_y, lane, measurement[0, lane], measurement[1, lane]
            )
            white_x = innovation_x * gain_x.whitener[lane]
            white_y = innovation_y * gain_y.whitener[lane]
            log_variance = 0.5 * (gain_x.log_variance[lane] + gain_y.log_variance[lane])
            innovation.white_x[lane] = white_x
            innovation.white_y[lane] = white_y
            innovation.log_variance[lane] = log_variance
            kalman.log_likelihood[lane] += log_likelihood(white_x, white_y, log_variance)


@internal
def follow_published(
    bank: PublishedBank, lane: int, hypothesis: int, measurement: FloatArray, model: Any
) -> None:
    """Advance the filter of one hypothesis of a lane by one tick. Golubkov 2018, algorithm 1, line 15.

    This is used after a decision. The log-likelihood is not updated.
    """
    axes, columns = bank.covariances.shape
    column = radius_column(hypothesis, columns - 1)
    for axis in range(axes):
        variance = model.variance_x if axis == 0 else model.variance_y
        shared, gain = bank.covariances[axis, column], bank.gains[axis, column]
        _step_covariance(shared, gain, lane, model.process_variance, variance)
    gain_x, gain_y = bank.gains[0, column], bank.gains[axes - 1, column]
    _step_estimate(
        bank.hypotheses[hypothesis], bank.covariances[0, column], gain_x, gain_y, lane,
        measurement[0, lane], measurement[1, lane],
    )  # fmt: skip


@internal
def likeliest(hypotheses: NDArray[Any], lane: int) -> int:
    """Return the hypothesis with the maximum log-likelihood, the first one if several are equal."""
    best = 0
    for h in range(1, hypotheses.size):
        if hypotheses[h].log_likelihood[lane] > hypotheses[best].log_likelihood[lane]:
            best = h
    return best


@internal
def estimate_of(hypotheses: NDArray[Any], hypothesis: int, lane: int) -> State:
    """Return the estimate [x, vx, y, vy] of one hypothesis [m, m/s]."""
    kalman = hypotheses[hypothesis]
    return kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]


@internal
def covariance_published(bank: PublishedBank, hypothesis: int, lane: int) -> Triangle4:
    """Return the covariance of [x, vx, y, vy] of one hypothesis, upper triangle row by row."""
    axes, columns = bank.covariances.shape
    column = radius_column(hypothesis, columns - 1)
    x, y = bank.covariances[0, column], bank.covariances[axes - 1, column]
    return (
        x.xx[lane], x.xv[lane], 0.0, 0.0, x.vv[lane], 0.0, 0.0,
        y.xx[lane], y.xv[lane], y.vv[lane],
    )  # fmt: skip
