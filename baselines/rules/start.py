"""The first estimate of a live track, from its first measurements."""

import numpy as np

from hybrid_env.checks import FloatArray, IntArray
from hybrid_env.options import ModelOptions

FEW = 3
"""Measurements for a bank that runs on: it knows how inaccurate its estimate is, and corrects it."""

MANY = 10
"""Measurements for a bank that starts at a switch: the centre of its turns follows from the estimate."""


def line_estimate(
    ticks: IntArray, points: FloatArray, options: ModelOptions
) -> tuple[FloatArray, FloatArray]:
    """Fit a straight line to measurements by least squares, and evaluate it at the last one.

    The covariance has three parts: the noise of the measurements, the process noise, and the turns of the
    bank. The acceleration of a turn is across the velocity and constant, and all modes are equally probable.

    Args:
        ticks: (m,) tick of each measurement, increasing.
        points: (m, 2) measurements [m].
        options: of the model.

    Returns:
        Estimate [x, vx, y, vy] [m, m/s] and its covariance, (4, 4). A single measurement tells nothing about
        the velocity: it is 0, with an infinite variance.
    """
    variances = np.broadcast_to(options.variances, 2)
    if len(ticks) == 1:
        x, y = points[0]
        return np.array([x, 0.0, y, 0.0]), np.diag([variances[0], np.inf, variances[1], np.inf])
    ages = ticks[-1] - ticks
    times = options.tau * ages
    weights = np.linalg.pinv(np.stack([np.ones_like(times), -times], axis=1))  # of position and velocity
    estimate = (weights @ points).T.ravel()
    # the noise that a velocity gets i ticks before the last measurement has moved the earlier positions
    moved = weights @ (options.tau * np.maximum(ages[:, None] - np.arange(ages[0]), 0))
    covariance = np.kron(np.diag(variances), weights @ weights.T)
    covariance += np.kron(np.eye(2), options.process_variance * moved @ moved.T)
    velocity = estimate[1::2]
    speed = float(np.hypot(*velocity))
    if speed > 0.0:
        turn_rates = np.minimum(speed / np.array(options.radii), np.pi / options.tau)
        acceleration = 2.0 * float(((speed * turn_rates) ** 2).sum()) / options.hypotheses  # mean square
        bend = weights @ (0.5 * times**2)
        across = np.array([-velocity[1], velocity[0]]) / speed
        covariance += acceleration * np.kron(np.outer(across, across), np.outer(bend, bend))
    return estimate, covariance


class FirstMeasurements:
    """Collects measurements until more of them would not make the estimate of the velocity better.

    The line is fitted to the last of them, as many as give the smallest variance of the velocity: few if the
    object turns by a large angle in a tick, many if the measurements are noisy.

    Args:
        options: of the model.
        most: largest number of measurements.

    Attributes:
        estimate, covariance: see `line_estimate`; NaN and infinite before the first measurement.
        complete: whether a track can begin with the estimate.
    """

    def __init__(self, options: ModelOptions, most: int):
        self.options, self.most = options, most
        self.estimate: FloatArray = np.full(4, np.nan)
        self.covariance: FloatArray = np.diag(np.full(4, np.inf))
        self.complete = False
        self._tick = 0
        self._ticks: list[int] = []
        self._points: list[tuple[float, float]] = []

    def skip(self) -> None:
        """Advance by one tick without a measurement; the estimate moves on along the line."""
        self._tick += 1
        motion = np.kron(np.eye(2), [[1.0, self.options.tau], [0.0, 1.0]])
        self.estimate = motion @ self.estimate
        if len(self._ticks) > 1:  # otherwise a variance is infinite
            process = np.diag([0.0, self.options.process_variance] * 2)
            self.covariance = motion @ self.covariance @ motion.T + process

    def add(self, x: float, y: float) -> None:
        """Advance by one tick with a measurement [m]."""
        self._tick += 1
        self._ticks.append(self._tick)
        self._points.append((x, y))
        ticks, points = np.array(self._ticks), np.array(self._points)
        fits = [line_estimate(ticks[-m:], points[-m:], self.options) for m in range(2, len(ticks) + 1)]
        if not fits:
            self.estimate, self.covariance = line_estimate(ticks, points, self.options)
            return
        variances = [covariance[1, 1] + covariance[3, 3] for _, covariance in fits]
        best = int(np.argmin(variances))
        self.estimate, self.covariance = fits[best]
        self.complete = best + 1 < len(fits) or len(ticks) >= self.most
