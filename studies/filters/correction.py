"""The correction of Kalman filters by measured positions, plain and robust against outliers.

The components of a measurement along the principal axes of its covariance, which have independent
errors, are processed one after the other, without an inverse. Bar-Shalom, Li & Kirubarajan 2001,
section 7.4 (sequential processing). Of a component let y be the innovation, m the variance of the
prediction, r that of the error, and c its column of the covariance P of the state. Every method
adds c y a to the state and subtracts c c' b from P, with its own a and b; for the Kalman filter a =
b = 1 / (m + r).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from studies.arrays import FloatArray

LOG_TWO_PI = float(np.log(2.0 * np.pi))


# Corrections a and b by one component of a measurement [1/m^2], and the log-likelihood of its
# innovation, (B,) each.
Factors = tuple[FloatArray, FloatArray, FloatArray]


def gaussian_factors(
    innovation: FloatArray, predicted: FloatArray, variance: FloatArray
) -> Factors:
    """Return the factors of the Kalman filter for innovations y (B,) [m] of variances
    predicted m and measured r, (B,) [m^2].
    """
    total = predicted + variance
    precision = 1.0 / total
    log_likelihood = -0.5 * (innovation**2 * precision + np.log(total) + LOG_TWO_PI)
    return precision, precision, log_likelihood


@dataclass(frozen=True)
class StudentT:
    """Measurement noise with a Student-t distribution.

    Student-t noise is Gaussian with the variance r / w, and w has a gamma distribution; the
    variance of the noise is nu / (nu - 2) times the squared scale r. The posterior is a mixture
    over w; mean, covariance and likelihood of it are computed by quadrature at equal steps of ln w,
    exact for a Gaussian prediction (Masreliez 1975).
    """

    # Nu, from 0.1 to 1000; 1 is Cauchy noise, 1000 practically Gaussian.
    degrees_of_freedom: float = 4.0

    def __post_init__(self) -> None:
        nu = self.degrees_of_freedom
        # The integrand is analytic: errors of about 1e-8.
        step = min(0.5, np.sqrt(2.0 / nu))
        # Standard deviations; the weights of farther measurements do not fall any more.
        farthest = 1e6
        lowest = min(np.log((nu + 1.0) / (nu + farthest**2)), -40.0 / nu)
        logs = np.arange(max(lowest, np.log(1e-16)), np.log(2.0 + 80.0 / nu), step)
        density = 0.5 * nu * (logs - np.exp(logs)) + 0.5 * nu * np.log(0.5 * nu) - gammaln(0.5 * nu)
        shares = density + np.log(step) - 0.5 * LOG_TWO_PI
        object.__setattr__(self, "_quadrature", (np.exp(-logs), shares))

    def factors(
        self, innovation: FloatArray, predicted: FloatArray, variance: FloatArray
    ) -> Factors:
        """See `gaussian_factors`."""
        inverse_weights, log_shares = vars(self)["_quadrature"]
        total = variance[:, None] * inverse_weights + predicted[:, None]
        precision = 1.0 / total
        squares = innovation**2
        logs = 0.5 * (np.log(precision) - squares[:, None] * precision) + log_shares
        largest = logs.max(-1)
        share = np.exp(logs - largest[:, None])
        norm = share.sum(-1)
        mean = (share * precision).sum(-1) / norm
        spread = (share * (precision - mean[:, None]) ** 2).sum(-1) / norm
        return mean, mean - squares * spread, largest + np.log(norm)


def correct(
    state: FloatArray,
    covariance: FloatArray,
    measurement: FloatArray,
    variances: FloatArray,
    axes: FloatArray,
    robust: StudentT | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Correct predicted estimates, (B, n) and (B, n, n), by measured positions (B, d) [m].

    Args:
        state, covariance, measurement: see above.
        variances, axes: (B, d) [m^2] and (B, d, d), eigenvalues and eigenvectors, as columns, of
            the covariances of the measurements.
        robust: law of the errors; None is the Kalman filter.

    Returns:
        estimates, covariances, and (B,) the log-likelihood of the measurement.
    """
    m = state.shape[-1] // measurement.shape[-1]
    factors = gaussian_factors if robust is None else robust.factors
    log_likelihood = np.zeros(len(state))
    for variance, axis in zip(variances.T, np.moveaxis(axes, -1, 0), strict=True):
        # P h.
        cross = (covariance[..., ::m] @ axis[..., None])[..., 0]
        innovation = ((measurement - state[..., ::m]) * axis).sum(-1)
        predicted = (cross[..., ::m] * axis).sum(-1)
        of_state, of_covariance, log_density = factors(innovation, predicted, variance)
        state = state + cross * (of_state * innovation)[:, None]
        removed = of_covariance[:, None, None] * cross[:, :, None] * cross[:, None, :]
        covariance = covariance - removed
        log_likelihood += log_density
    return state, covariance, log_likelihood
