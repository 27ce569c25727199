"""Robust updates of a Kalman filter: the weight of a measurement falls with its distance from the estimate.

Each method weights the components of a measurement along the principal axes of its covariance R, because
outliers of a sensor are usually independent along them: with the weight w_i the component has the variance
r_i / w_i. With `by="vector"` all components of a measurement have one weight. The weights depend on the
residual z - H x, and x on the weights; the fixed point is found by iteration (iteratively reweighted least
squares). It starts from the innovation in units of its own covariance S, so that a far measurement is used
where the prediction is uncertain, as after a gap, and not where it is certain.

`log_density` gives the likelihood of the whitened innovation. For Huber and Student-t it is a density. The
others have a bounded loss, which has none: theirs compares motion models, not parameters of the loss.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc, gammaln

from baselines.filters.correction import PrincipalNoise, correct
from hybrid_env.checks import check_choice, check_integer, check_positive

FloatArray = NDArray[np.float64]
LOG_TWO_PI = float(np.log(2.0 * np.pi))
SMALLEST_WEIGHT = 1e-12  # the variance of a component is at most 10^12 times as large
CONVERGED = 1e-4  # largest relative change of a weight at which the iteration ends


@dataclass(frozen=True, kw_only=True)
class Robust(ABC):
    """A robust update.

    Attributes:
        by: "axis" weights every component of a measurement, "vector" the measurement as a whole.
        iterations: largest number of iterations of the fixed point.

    Raises:
        ArgumentError: an attribute has a value that is not allowed.
    """

    by: Literal["axis", "vector"] = "axis"
    iterations: int = 20
    expected: ClassVar[bool] = False
    """Whether the weight is that of the expected squared residual, not of the residual of the estimate."""

    def __post_init__(self) -> None:
        check_choice("by", self.by, ("axis", "vector"))
        check_integer("iterations", self.iterations)
        self._check()

    def weights(self, squares: FloatArray) -> FloatArray:
        """Weights, (B, d), of squared residuals in units of their variances, (B, d)."""
        if self.by == "axis":
            return self._weight(squares, 1)
        total = squares.sum(-1, keepdims=True)
        return np.broadcast_to(self._weight(total, squares.shape[-1]), squares.shape)

    def log_density(self, white: FloatArray) -> FloatArray:
        """Logarithm of the density, (B,), of whitened innovations, (B, d)."""
        squares = white**2
        if self.by == "axis":
            return self._log_density(squares, 1).sum(-1)
        return self._log_density(squares.sum(-1), squares.shape[-1])

    @abstractmethod
    def _check(self) -> None: ...

    @abstractmethod
    def _weight(self, squares: FloatArray, size: int) -> FloatArray:
        """Weights of the squared lengths of vectors with so many components."""

    @abstractmethod
    def _log_density(self, squares: FloatArray, size: int) -> FloatArray:
        """Logarithm of the density of a vector with so many components, by its squared length."""


@dataclass(frozen=True, kw_only=True)
class Huber(Robust):
    """Huber's loss: quadratic up to a threshold, then linear. Huber 1964; Durovic & Kovacevic 1999.

    The estimate is the maximum of the posterior of a Gaussian prior and this loss. The weight is 1 up to the
    threshold and then threshold / residual.

    Attributes:
        threshold: in standard deviations, > 0. With 1.345 a location has 95 % efficiency with Gaussian noise.
    """

    threshold: float = 1.345

    def _check(self) -> None:
        check_positive("threshold", self.threshold)

    def _weight(self, squares: FloatArray, size: int) -> FloatArray:
        return self.threshold / np.maximum(np.sqrt(squares), self.threshold)

    def _log_density(self, squares: FloatArray, size: int) -> FloatArray:
        length, k = np.sqrt(squares), self.threshold
        loss = np.where(length <= k, 0.5 * squares, k * length - 0.5 * k * k)
        return -loss - _log_huber_integral(k, size)


def _log_huber_integral(k: float, size: int) -> float:
    """Logarithm of the integral of exp(-loss) over vectors with so many components.

    The part inside the threshold is an incomplete gamma function; the part outside, the integral of
    r^(size - 1) exp(k^2 / 2 - k r) from k, follows by repeated integration by parts.
    """
    log_inside = 0.5 * size * LOG_TWO_PI + np.log(gammainc(0.5 * size, 0.5 * k * k))
    outside = total = k ** (size - 1) / k
    for power in range(size - 1, 0, -1):
        outside *= power / (k * k)
        total += outside
    log_sphere = np.log(2.0) + 0.5 * size * np.log(np.pi) - gammaln(0.5 * size)
    return float(np.logaddexp(log_inside, log_sphere - 0.5 * k * k + np.log(total)))


@dataclass(frozen=True, kw_only=True)
class StudentT(Robust):
    """Measurement noise with a Student-t distribution. Piche, Sarkka & Hartikainen 2012 (variational Bayes).

    The weight is (nu + d) / (nu + residual^2), with the expected squared residual under the estimate's own
    covariance; d = 1 by axis.

    Attributes:
        degrees_of_freedom: nu > 0; 1 is Cauchy noise, large values are Gaussian. The covariance of a
            measurement is the scale matrix; the variance is nu / (nu - 2) times as large.
    """

    expected: ClassVar[bool] = True
    degrees_of_freedom: float = 4.0

    def _check(self) -> None:
        check_positive("degrees_of_freedom", self.degrees_of_freedom)

    def _weight(self, squares: FloatArray, size: int) -> FloatArray:
        return (self.degrees_of_freedom + size) / (self.degrees_of_freedom + squares)

    def _log_density(self, squares: FloatArray, size: int) -> FloatArray:
        nu = self.degrees_of_freedom
        constant = gammaln(0.5 * (nu + size)) - gammaln(0.5 * nu) - 0.5 * size * np.log(nu * np.pi)
        return np.asarray(constant - 0.5 * (nu + size) * np.log1p(squares / nu))


@dataclass(frozen=True, kw_only=True)
class MaximumCorrentropy(Robust):
    """Gaussian kernel of the residual as weight, exp(-residual^2 / (2 bandwidth^2)). Izanloo et al. 2016.

    The kernel weights the measurement; the prediction keeps its covariance (Chen et al. 2017 weight both).

    Attributes:
        bandwidth: of the kernel in standard deviations, > 0.
    """

    bandwidth: float = 3.0

    def _check(self) -> None:
        check_positive("bandwidth", self.bandwidth)

    def _weight(self, squares: FloatArray, size: int) -> FloatArray:
        return np.exp(-0.5 * np.minimum(squares / self.bandwidth**2, 1e3))

    def _log_density(self, squares: FloatArray, size: int) -> FloatArray:
        width = self.bandwidth**2
        loss = -width * np.expm1(-0.5 * np.minimum(squares / width, 1e3))
        return -loss - 0.5 * size * LOG_TWO_PI


@dataclass(frozen=True, kw_only=True)
class Gate(Robust):
    """Innovations outside a gate are not used. Bar-Shalom, Li & Kirubarajan 2001, section 1.4 (gating).

    The gate widens with the covariance of the prediction, so that a lost track is found again if it has
    process noise.

    Attributes:
        threshold: largest innovation that is used, in its standard deviations, > 0.
    """

    threshold: float = 4.0
    iterations: int = 0

    def __post_init__(self) -> None:
        check_choice("by", self.by, ("axis", "vector"))
        check_integer("iterations", self.iterations, 0, 0)  # the innovation decides, not the residual
        self._check()

    def _check(self) -> None:
        check_positive("threshold", self.threshold)

    def _weight(self, squares: FloatArray, size: int) -> FloatArray:
        return np.where(squares <= self.threshold**2, 1.0, 0.0)

    def _log_density(self, squares: FloatArray, size: int) -> FloatArray:
        return -0.5 * np.minimum(squares, self.threshold**2) - 0.5 * size * LOG_TWO_PI


def robust_noise(
    robust: Robust, innovation: FloatArray, predicted: FloatArray, variances: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Variances of measurements with the weights of a robust update.

    Args:
        robust: the method.
        innovation: (B, d) along the principal axes of the measurement, see `turned_positions`.
        predicted: (B, d, d) covariance H P H' of the predicted positions, along the same axes.
        variances: (d,) or (B, d) of the measurement.

    Returns:
        Weighted variances, (B, d), and whitened innovations and their scale without weights, see `Corrected`.
    """
    variances = np.broadcast_to(variances, innovation.shape)
    none = np.zeros_like(innovation)  # the position, relative to the prediction
    plain = correct(none, predicted, innovation, PrincipalNoise(variances, None))
    spread = np.diagonal(predicted, axis1=1, axis2=2)
    weights = np.maximum(robust.weights(innovation**2 / (spread + variances)), SMALLEST_WEIGHT)
    moving = np.arange(len(innovation))  # tracks whose weights still change
    for _ in range(robust.iterations):
        y, r, w = innovation[moving], variances[moving], weights[moving]
        after = correct(none[moving], predicted[moving], y, PrincipalNoise(r / w, None))
        squares = (y - after.state) ** 2
        if robust.expected:
            squares += np.diagonal(after.covariance, axis1=1, axis2=2)
        new = np.maximum(robust.weights(squares / r), SMALLEST_WEIGHT)
        weights[moving] = new
        moving = moving[(np.abs(new - w) > CONVERGED * w).any(-1)]
        if not moving.size:
            break
    return variances / weights, plain.white, plain.log_scale
