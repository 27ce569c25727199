"""The correction of Kalman filters by measured positions, plain and robust against outliers.

The components of a measurement along the principal axes of its covariance, which have independent
errors, are processed one after the other, without an inverse. Bar-Shalom, Li & Kirubarajan 2001,
section 7.4 (sequential processing). Of a component let y be the innovation, m the variance of the
prediction, r that of the error, and c its column of the covariance P of the state. Every method
adds c y a to the state and subtracts c c' b from P, with its own a and b; for the Kalman filter a =
b = 1 / (m + r). The log-likelihood of the innovation is exact for Student-t; for Huber it is that
of the density that belongs to the loss, with the scale of the innovation.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval
from scipy.special import gammaln, ndtr

from hybrid_env.checks import BoolArray, Checked, FloatArray, Positive

LOG_TWO_PI = float(np.log(2.0 * np.pi))


class Factors(NamedTuple):
    """Correction by one component of a measurement, (B,) each."""

    # a, of the state [1/m^2].
    state: FloatArray
    # b, of its covariance [1/m^2].
    covariance: FloatArray
    # Of the innovation.
    log_likelihood: FloatArray


def gaussian_factors(
    innovation: FloatArray,
    predicted: FloatArray,
    variance: FloatArray,
) -> Factors:
    """Return the factors of the Kalman filter, see `Robust.factors`."""
    total = predicted + variance
    precision = 1.0 / total
    log_likelihood = -0.5 * (innovation**2 * precision + np.log(total) + LOG_TWO_PI)
    return Factors(precision, precision, log_likelihood)


class Robust(Checked, ABC):
    """A robust correction."""

    @abstractmethod
    def factors(
        self,
        innovation: FloatArray,
        predicted: FloatArray,
        variance: FloatArray,
    ) -> Factors:
        """Return the factors for innovations y (B,) [m] of variances predicted m and measured r,
        (B,) [m^2].
        """


@dataclass(frozen=True)
class Huber(Robust):
    """Huber's loss: quadratic up to a threshold, then linear. Huber 1964; Durovic & Kovacevic 1999.

    The estimate is the maximum of the posterior with a Gaussian prediction and this loss of the
    residual. The weight of a measurement beyond the threshold, by which the covariance is
    corrected, is threshold / residual.
    """

    # Standard deviations, > 0; with Gaussian noise a mean has 95 % of the efficiency.
    threshold: Positive = 1.345

    def factors(
        self,
        innovation: FloatArray,
        predicted: FloatArray,
        variance: FloatArray,
    ) -> Factors:
        """See `Robust.factors`."""
        total = predicted + variance
        size = np.abs(innovation)
        deviation = np.sqrt(variance)
        k = self.threshold
        # The residual y r / (m + r) exceeds the threshold.
        linear = size * deviation > k * total
        residual = np.where(linear, size - k * predicted / deviation, k * deviation)
        weighted = np.where(linear, deviation * residual / k, variance)
        precision = 1.0 / (predicted + weighted)
        white = size / np.sqrt(total)
        loss = np.where(white <= k, 0.5 * white**2, k * white - 0.5 * k * k)
        inside = np.sqrt(2.0 * np.pi) * (2.0 * ndtr(k) - 1.0)
        # Of exp(-loss) over all numbers.
        integral = inside + 2.0 / k * np.exp(-0.5 * k * k)
        log_likelihood = -loss - 0.5 * np.log(total) - np.log(integral)
        return Factors(precision, precision, log_likelihood)


@dataclass(frozen=True)
class StudentT(Robust):
    """Measurement noise with a Student-t distribution.

    Student-t noise is Gaussian with the variance r / w, and w has a gamma distribution; the
    variance of the noise is nu / (nu - 2) times the squared scale r. The posterior is a mixture
    over w; mean, covariance and likelihood of it are computed by quadrature at equal steps of ln w,
    exact for a Gaussian prediction (Masreliez 1975).
    """

    # Nu, from 0.1 to 1000; 1 is Cauchy noise, 1000 practically Gaussian.
    degrees_of_freedom: Annotated[float, Interval(ge=0.1, le=1000.0)] = 4.0

    def __post_init__(self) -> None:
        super().__post_init__()
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
        self,
        innovation: FloatArray,
        predicted: FloatArray,
        variance: FloatArray,
    ) -> Factors:
        """See `Robust.factors`."""
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
        return Factors(mean, mean - squares * spread, largest + np.log(norm))


@dataclass(frozen=True)
class Correntropy(Robust):
    """Maximum of the correntropy of prediction and measurement. Chen, Liu, Zhao & Principe 2017,
    algorithm 1: residuals of both, in their standard deviations, have weights exp(-residual^2 / (2
    width^2)), by fixed-point iterations. The covariance is that of the gain with the assumed
    variances; a large width gives the Kalman filter.
    """

    width: Positive = 3.0

    def factors(
        self,
        innovation: FloatArray,
        predicted: FloatArray,
        variance: FloatArray,
    ) -> Factors:
        """See `Robust.factors`."""
        # From the prediction on.
        gain = np.zeros_like(predicted)
        squares = innovation**2
        least = 1e-12
        scale = 2.0 * self.width**2
        for _ in range(10):
            of_prediction = np.exp(-squares * gain**2 / (scale * predicted))
            of_measurement = np.exp(-squares * (1.0 - gain) ** 2 / (scale * variance))
            ratio = np.maximum(of_measurement, least) / np.maximum(of_prediction, least)
            gain = predicted * ratio / (predicted * ratio + variance)
        state = gain / predicted
        total = predicted + variance / np.maximum(ratio, least)
        log_likelihood = -0.5 * (squares / total + np.log(total) + LOG_TWO_PI)
        return Factors(state, state * (2.0 - state * (predicted + variance)), log_likelihood)


class PrincipalNoise(NamedTuple):
    """Covariances of measurements along their principal axes."""

    # (d,) or (..., d) [m^2]
    variances: FloatArray
    # (d, d) or (..., d, d) unit vectors as columns; None if they are the axes of the positions.
    axes: FloatArray | None

    def of(self, tracks: BoolArray) -> "PrincipalNoise":
        """Return the covariances of the tracks selected by a mask (B,)."""
        variances, axes = self
        variances = variances[tracks] if variances.ndim == 2 else variances
        return PrincipalNoise(variances, axes if axes is None or axes.ndim == 2 else axes[tracks])


def principal_noise(covariance: FloatArray) -> PrincipalNoise:
    """Return the principal axes of covariances of measurements, (d, d) or (..., d, d)."""
    diagonal = np.diagonal(covariance, axis1=-2, axis2=-1)
    if np.count_nonzero(covariance) == np.count_nonzero(diagonal):
        return PrincipalNoise(diagonal.copy(), None)
    variances, axes = np.linalg.eigh(covariance)
    return PrincipalNoise(variances, axes)


def correct(
    state: FloatArray,
    covariance: FloatArray,
    measurement: FloatArray,
    noise: PrincipalNoise,
    robust: Robust | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Correct predicted estimates, (..., n) and (..., n, n), by measured positions (..., d) [m].
    `robust` says how components far from the prediction are used; None is the Kalman filter.
    Returns estimates, covariances, and (...) the log-likelihood of the measurement and its squared
    innovation in units of its covariance.
    """
    state = state.copy()
    covariance = covariance.copy()
    lead = state.shape[:-1]
    d = measurement.shape[-1]
    m = state.shape[-1] // d
    variances = np.broadcast_to(noise.variances, (*lead, d))
    log_likelihood = np.zeros(lead)
    nis = np.zeros(lead)
    for i in range(d):
        variance = variances[..., i]
        if noise.axes is None:
            cross = covariance[..., m * i].copy()
            innovation = measurement[..., i] - state[..., m * i]
            predicted = cross[..., m * i].copy()
        else:
            axis = np.broadcast_to(noise.axes[..., i], (*lead, d))
            # P h.
            cross = (covariance[..., ::m] @ axis[..., None])[..., 0]
            innovation = ((measurement - state[..., ::m]) * axis).sum(-1)
            predicted = (cross[..., ::m] * axis).sum(-1)
        factors = (gaussian_factors if robust is None else robust.factors)(
            innovation,
            predicted,
            variance,
        )
        state += cross * (factors.state * innovation)[..., None]
        covariance -= (cross * factors.covariance[..., None])[..., :, None] * cross[..., None, :]
        if noise.axes is None:
            # m / (m + r) is close to 1 for very accurate measurements: 1 - m b is then r b.
            exact = variance * factors.covariance
            left = exact if robust is None else 1.0 - predicted * factors.covariance
            after = cross * left[..., None]
            covariance[..., m * i] = after
            covariance[..., m * i, :] = after
        log_likelihood += factors.log_likelihood
        nis += innovation**2 / (predicted + variance)
    return state, covariance, log_likelihood, nis
