"""The bank of Kalman filters, one per hypothesis: straight, left turns, right turns.

Golubkov 2018, eq. (2) and (4). Process and measurement noise are diagonal, so the 4x4 filter of the paper
is two filters (position, velocity), one an axis. Their covariances do not depend on the data, only on the
turn rate, so a left and a right turn of one radius share them, and so do the axes where the measurement
noise is equal on both. What is left per hypothesis is four numbers of state, two of innovation and one
log-likelihood.

Arrays of one track, for M = 2n + 1 hypotheses of n radii and A = 1 or 2 noise axes:

    filters  (9, M)         rows named by the constants X .. LOG_LIKELIHOOD, hypothesis innermost
    motion   (3, n + 1)     transition coefficients; column 0 is straight, column c has radius c - 1
    gains    (A, 7, n + 1)  covariance, innovation variance and gain, rows P_XX .. GAIN_V

Hypothesis 0 is straight, 1 .. n turn left, n + 1 .. 2n turn right.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from hybrid_env.checks import check_array, check_positive, check_radii
from hybrid_env.motion import heading_vector, motion_coefficients, propagate, turn_centre

FloatArray = NDArray[np.float64]

# rows of `filters`
X, VX, Y, VY = 0, 1, 2, 3  # estimate [m, m/s]
CENTRE_X, CENTRE_Y = 4, 5  # [m]
WHITE_X, WHITE_Y = 6, 7  # innovation over its standard deviation
LOG_LIKELIHOOD = 8  # cumulative since the switch
FILTER_ROWS = 9

# rows of `motion`
COSINE, SINE_VELOCITY, SINE_POSITION = 0, 1, 2
MOTION_ROWS = 3

# rows of `gains`, per noise axis
P_XX, P_XV, P_VV = 0, 1, 2  # covariance of (position, velocity) [m^2, m^2/s, m^2/s^2]
WHITENER, LOG_VARIANCE = 3, 4  # of the innovation: 1 / standard deviation [1/m], ln variance
GAIN_X, GAIN_V = 5, 6
GAIN_ROWS = 7

LOG_TWO_PI = math.log(2.0 * math.pi)


@njit(cache=True)
def anchor_bank(
    filters: FloatArray,
    motion: FloatArray,
    gains: FloatArray,
    anchor: FloatArray,
    radii: FloatArray,
    tau: float,
    covariance: FloatArray,
) -> None:
    """Start every hypothesis at one estimate, its turn rate and centre computed from that estimate.

    Args:
        anchor: (4,) estimate [x, vx, y, vy] at the switch [m, m/s].
        radii: (n,) turn radii of the bank [m].
        tau: tick [s].
        covariance: (A, 3) starting covariance, P_XX, P_XV, P_VV of each noise axis. In the published
            algorithms the identity at every piece (Tsyganov 2019, line 28; Golubkov 2018, setFilters).
    """
    n = radii.size
    speed, heading_x, heading_y = heading_vector(anchor[1], anchor[3])
    motion[COSINE, 0], motion[SINE_VELOCITY, 0], motion[SINE_POSITION, 0] = motion_coefficients(0.0, tau)
    for c in range(1, n + 1):
        cosine, sine_velocity, sine_position = motion_coefficients(speed / radii[c - 1], tau)
        motion[COSINE, c] = cosine
        motion[SINE_VELOCITY, c] = sine_velocity
        motion[SINE_POSITION, c] = sine_position
    for axis in range(gains.shape[0]):
        for c in range(n + 1):
            gains[axis, P_XX, c] = covariance[axis, 0]
            gains[axis, P_XV, c] = covariance[axis, 1]
            gains[axis, P_VV, c] = covariance[axis, 2]
    for h in range(2 * n + 1):
        filters[X, h], filters[VX, h], filters[Y, h], filters[VY, h] = anchor
        filters[LOG_LIKELIHOOD, h] = 0.0
        radius = 0.0
        if h > n:
            radius = -radii[h - n - 1]
        elif h > 0:
            radius = radii[h - 1]
        filters[CENTRE_X, h], filters[CENTRE_Y, h] = turn_centre(
            anchor[0], anchor[2], heading_x, heading_y, radius
        )


@njit(cache=True)
def step_gains(
    motion: FloatArray, gains: FloatArray, column: int, process_variance: float, variances: FloatArray
) -> None:
    """Covariance and gain of one radius over one tick. Golubkov 2018, eq. (2); Sigma = H P H' + R."""
    cosine = motion[COSINE, column]
    sine_velocity = motion[SINE_VELOCITY, column]
    sine_position = motion[SINE_POSITION, column]
    for axis in range(gains.shape[0]):
        xx, xv, vv = gains[axis, P_XX, column], gains[axis, P_XV, column], gains[axis, P_VV, column]
        row_x_x = cosine * xx + sine_velocity * xv  # first row of Phi P
        row_x_v = cosine * xv + sine_velocity * vv
        row_v_x = cosine * xv - sine_position * xx  # second row of Phi P
        row_v_v = cosine * vv - sine_position * xv
        xx = cosine * row_x_x + sine_velocity * row_x_v
        xv = cosine * row_x_v - sine_position * row_x_x
        vv = cosine * row_v_v - sine_position * row_v_x + process_variance
        variance = xx + variances[axis]
        inverse = 1.0 / variance
        gain_x = xx * inverse
        gain_v = xv * inverse
        gains[axis, P_XX, column] = gain_x * variances[axis]  # P - K H P, without its cancellation
        gains[axis, P_XV, column] = gain_v * variances[axis]
        gains[axis, P_VV, column] = vv - gain_v * xv
        gains[axis, WHITENER, column] = math.sqrt(inverse)
        gains[axis, LOG_VARIANCE, column] = math.log(variance)
        gains[axis, GAIN_X, column] = gain_x
        gains[axis, GAIN_V, column] = gain_v


@njit(cache=True)
def step_estimate(
    filters: FloatArray,
    motion: FloatArray,
    gains: FloatArray,
    hypothesis: int,
    column: int,
    measurement_x: float,
    measurement_y: float,
) -> None:
    """Predict, compare with the measurement, correct, add to the log-likelihood: one hypothesis, one tick.

    Golubkov 2018, eq. (2); the increment is ln N(nu; 0, Sigma), whose differences are eq. (4).
    """
    cosine = motion[COSINE, column]
    sine_velocity = motion[SINE_VELOCITY, column]
    sine_position = motion[SINE_POSITION, column]
    y_axis = gains.shape[0] - 1
    x, vx = propagate(
        filters[X, hypothesis], filters[VX, hypothesis], filters[CENTRE_X, hypothesis],
        cosine, sine_velocity, sine_position,
    )  # fmt: skip
    y, vy = propagate(
        filters[Y, hypothesis], filters[VY, hypothesis], filters[CENTRE_Y, hypothesis],
        cosine, sine_velocity, sine_position,
    )  # fmt: skip
    innovation_x = measurement_x - x
    innovation_y = measurement_y - y
    filters[X, hypothesis] = x + gains[0, GAIN_X, column] * innovation_x
    filters[VX, hypothesis] = vx + gains[0, GAIN_V, column] * innovation_x
    filters[Y, hypothesis] = y + gains[y_axis, GAIN_X, column] * innovation_y
    filters[VY, hypothesis] = vy + gains[y_axis, GAIN_V, column] * innovation_y
    white_x = innovation_x * gains[0, WHITENER, column]
    white_y = innovation_y * gains[y_axis, WHITENER, column]
    filters[WHITE_X, hypothesis] = white_x
    filters[WHITE_Y, hypothesis] = white_y
    filters[LOG_LIKELIHOOD, hypothesis] -= LOG_TWO_PI + 0.5 * (
        gains[0, LOG_VARIANCE, column]
        + gains[y_axis, LOG_VARIANCE, column]
        + white_x * white_x
        + white_y * white_y
    )


@njit(cache=True)
def mode_type(mode: int, radii_count: int) -> int:
    """0 straight, 1 left, 2 right."""
    return 0 if mode == 0 else (1 if mode <= radii_count else 2)


@njit(cache=True)
def likeliest(filters: FloatArray) -> int:
    """The hypothesis with the largest log-likelihood, the first of equals."""
    best = 0
    for h in range(1, filters.shape[1]):
        if filters[LOG_LIKELIHOOD, h] > filters[LOG_LIKELIHOOD, best]:
            best = h
    return best


@njit(cache=True)
def radius_column(hypothesis: int, radii_count: int) -> int:
    """Column of `motion` and `gains` that a hypothesis uses."""
    return hypothesis - radii_count if hypothesis > radii_count else hypothesis


@njit(cache=True)
def copy_estimate(filters: FloatArray, hypothesis: int, estimate: FloatArray) -> None:
    """Write [x, vx, y, vy] of one hypothesis into estimate, (4,)."""
    for row in range(4):
        estimate[row] = filters[row, hypothesis]


@njit(cache=True)
def copy_covariance(gains: FloatArray, hypothesis: int, covariance: FloatArray) -> None:
    """Write P_XX, P_XV, P_VV of one hypothesis into covariance, (2, 3) for x and y or (A, 3)."""
    column = radius_column(hypothesis, gains.shape[2] - 1)
    for axis in range(covariance.shape[0]):
        for row in range(3):
            covariance[axis, row] = gains[min(axis, gains.shape[0] - 1), row, column]


@njit(cache=True)
def step_bank(
    filters: FloatArray,
    motion: FloatArray,
    gains: FloatArray,
    measurement_x: float,
    measurement_y: float,
    process_variance: float,
    variances: FloatArray,
) -> None:
    """One tick of every hypothesis. measurement [m]; process_variance Q [m^2/s^2]; variances (A,) R [m^2]."""
    columns = motion.shape[1]
    for column in range(columns):
        step_gains(motion, gains, column, process_variance, variances)
    for column in range(columns):  # straight and left turns
        step_estimate(filters, motion, gains, column, column, measurement_x, measurement_y)
    for column in range(1, columns):  # right turns
        step_estimate(filters, motion, gains, column + columns - 1, column, measurement_x, measurement_y)


@njit(cache=True)
def step_chosen(
    filters: FloatArray,
    motion: FloatArray,
    gains: FloatArray,
    hypothesis: int,
    measurement_x: float,
    measurement_y: float,
    process_variance: float,
    variances: FloatArray,
) -> None:
    """One tick of one hypothesis alone, as after a decision. Golubkov 2018, algorithm 1, line 15."""
    column = radius_column(hypothesis, motion.shape[1] - 1)
    step_gains(motion, gains, column, process_variance, variances)
    step_estimate(filters, motion, gains, hypothesis, column, measurement_x, measurement_y)


class KalmanBank:
    """The bank of one track as an object, for notebooks and for one's own loops.

    >>> bank = KalmanBank(radii=[5.0], measurement_variance=0.1)
    >>> bank.anchor([0.0, 2.0, 0.0, 0.0])
    >>> bank.step([0.21, -0.03]).shape
    (3,)
    """

    def __init__(
        self,
        radii: ArrayLike = (5.0,),
        tau: float = 0.1,
        process_variance: float = 0.001,
        measurement_variance: float | ArrayLike = 0.1,
    ):
        self.radii = check_radii("radii", radii)
        self.tau = check_positive("tau", tau)
        self.process_variance = check_positive("process_variance", process_variance, allow_zero=True)
        self.variances = noise_axes(measurement_variance)
        self.filters, self.motion, self.gains = bank_arrays(1, self.radii.size, self.variances.size)
        self._anchored = False

    @property
    def hypotheses(self) -> int:
        """Number of hypotheses M = 2n + 1."""
        return 2 * self.radii.size + 1

    def anchor(self, state: ArrayLike, covariance: ArrayLike = (1.0, 0.0, 1.0)) -> None:
        """Start a segment at an estimate.

        Args:
            state: (4,) [x, vx, y, vy] [m, m/s].
            covariance: (3,) of (position, velocity), the same on both axes; the published bank's identity.
        """
        anchor = check_array("state", state, (4,))
        start = np.tile(check_array("covariance", covariance, (3,)), (self.variances.size, 1))
        anchor_bank(self.filters[0], self.motion[0], self.gains[0], anchor, self.radii, self.tau, start)
        self._anchored = True

    def step(self, measurement: ArrayLike) -> FloatArray:
        """One tick. measurement: (2,) [m]. Returns the cumulative log-likelihoods, (M,)."""
        if not self._anchored:
            raise RuntimeError("step() before anchor(): the bank has no starting estimate")
        x, y = check_array("measurement", measurement, (2,))
        step_bank(self.filters[0], self.motion[0], self.gains[0], x, y, self.process_variance, self.variances)
        return self.log_likelihood

    @property
    def log_likelihood(self) -> FloatArray:
        """(M,) log-likelihood of the measurements since the anchor."""
        return self.filters[0, LOG_LIKELIHOOD].copy()

    @property
    def estimates(self) -> FloatArray:
        """(M, 4) estimates [x, vx, y, vy] [m, m/s]."""
        return self.filters[0, [X, VX, Y, VY]].T.copy()

    @property
    def innovations(self) -> FloatArray:
        """(M, 2) innovations of the last tick [m]."""
        return self.filters[0, [WHITE_X, WHITE_Y]].T / self._by_hypothesis(WHITENER)

    @property
    def innovation_variances(self) -> FloatArray:
        """(M, 2) variance of the innovation on each axis [m^2]."""
        return self._by_hypothesis(WHITENER) ** -2.0

    @property
    def covariances(self) -> FloatArray:
        """(M, 2, 3) covariance of (position, velocity) on each axis: P_XX, P_XV, P_VV."""
        return np.stack([self._by_hypothesis(row) for row in (P_XX, P_XV, P_VV)], axis=-1)

    def _by_hypothesis(self, row: int) -> FloatArray:
        columns = [radius_column(h, self.radii.size) for h in range(self.hypotheses)]
        return self.gains[0, [0, -1], row][:, columns].T.copy()


def noise_axes(measurement_variance: float | ArrayLike) -> FloatArray:
    """Variance [m^2] of each distinct noise axis: (1,) where x and y are equal, else (2,)."""
    values = np.atleast_1d(np.asarray(measurement_variance))
    if values.size == 1:
        return np.array([check_positive("measurement_variance", values.item())])
    pair = check_array("measurement_variance", measurement_variance, (2,))
    for value in pair:
        check_positive("measurement_variance", value)
    return pair[:1].copy() if pair[0] == pair[1] else pair


def bank_arrays(tracks: int, radii_count: int, axes: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Zeroed `filters`, `motion` and `gains` of a number of tracks, the track outermost."""
    columns = radii_count + 1
    return (
        np.zeros((tracks, FILTER_ROWS, 2 * radii_count + 1)),
        np.zeros((tracks, MOTION_ROWS, columns)),
        np.zeros((tracks, axes, GAIN_ROWS, columns)),
    )
