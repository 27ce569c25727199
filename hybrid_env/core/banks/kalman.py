"""The Kalman filter of one axis, as scalar functions. Golubkov 2018, eq. (2) and (4). The process
and measurement noise covariances are diagonal, so the filter of the paper with four states
separates into two filters of (position, velocity), one per axis. A covariance is the tuple (xx, xv,
vv) [m^2, m^2/s, m^2/s^2].
"""

import math

from hybrid_env.core.compilation import formula, inlined
from hybrid_env.core.elementary import log

LOG_TWO_PI = math.log(2.0 * math.pi)

Covariance = tuple[float, float, float]


@inlined
def predict_covariance(
    covariance: Covariance,
    cosine: float,
    sine_velocity: float,
    sine_position: float,
    process_variance: float,
) -> Covariance:
    """Return the predicted covariance Phi P Phi' + G Q G' of one axis. Golubkov 2018, eq. (2).
    cosine, sine_velocity, sine_position: from `motion.motion_coefficients`.
    """
    xx, xv, vv = covariance
    # First row of Phi P.
    row_x_x = cosine * xx + sine_velocity * xv
    row_x_v = cosine * xv + sine_velocity * vv
    # Second row of Phi P.
    row_v_x = cosine * xv - sine_position * xx
    row_v_v = cosine * vv - sine_position * xv
    return (
        cosine * row_x_x + sine_velocity * row_x_v,
        cosine * row_x_v - sine_position * row_x_x,
        cosine * row_v_v - sine_position * row_v_x + process_variance,
    )


@inlined
def kalman_gain(covariance: Covariance, innovation_variance: float) -> tuple[float, float]:
    """Return K = P H' / Sigma, the gains of position and velocity [1, 1/s]. Golubkov 2018, eq.
    (2).
    """
    inverse = 1.0 / innovation_variance
    return covariance[0] * inverse, covariance[1] * inverse


@inlined
def correct_covariance(
    covariance: Covariance, gain_x: float, gain_v: float, variance: float
) -> Covariance:
    """Return the covariance P - K H P, corrected by a measurement of variance R. Golubkov 2018,
    eq. (2).
    """
    # The first row of P - K H P is K R, which avoids cancellation. The last entry is bounded below
    # so that rounding does not make P indefinite if the predicted variances are very large compared
    # with R.
    vv = max(covariance[2] - gain_v * covariance[1], gain_v * gain_v * variance)
    return gain_x * variance, gain_v * variance, vv


@formula
def student_log_likelihood(
    white_x: float, white_y: float, log_variance: float, freedom: float
) -> float:
    """Return the logarithm of the bivariate Student t density of an innovation; arguments of
    `weigh`.
    """
    distance = white_x * white_x + white_y * white_y
    return -(LOG_TWO_PI + log_variance + 0.5 * (freedom + 2.0) * log(1.0 + distance / freedom))


@formula
def student_weight(white_x: float, white_y: float, freedom: float) -> float:
    """Return the weight of a correction, (freedom + 2) / (freedom + d^2), d^2 the squared whitened
    innovation: the expected precision of the measurement relative to the assumed one. Lange, Little
    & Taylor 1989, eq. (4).
    """
    return min((freedom + 2.0) / (freedom + white_x * white_x + white_y * white_y), 1.0)


@formula
def weigh(
    white_x: float, white_y: float, log_variance: float, freedom: float | None
) -> tuple[float, float]:
    """Return the weight of the correction by a measurement, and the log-likelihood ln N(innovation;
    0, Sigma) of the tick, whose differences between hypotheses are the ratios of Golubkov 2018, eq.
    (4), from the whitened innovation and ln of its variance, mean of the axes. With a freedom > 0
    innovations have a Student t distribution whose scale matrix is the innovation variance, and the
    correction is weighted as in Agamennoni, Nieto & Nebot 2012, "Approximate inference in
    state-space models with heavy-tailed noise", with one iteration; the covariances stay those of
    the Kalman filter.
    """
    if freedom is not None and freedom > 0.0:
        return (
            student_weight(white_x, white_y, freedom),
            student_log_likelihood(white_x, white_y, log_variance, freedom),
        )
    return 1.0, -(LOG_TWO_PI + log_variance + 0.5 * (white_x * white_x + white_y * white_y))
