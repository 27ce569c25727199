"""The first estimate of a live track, from its first measurements, and the gate of the later ones.
A measurement that no motion explains is an error of the sensor, or a new track: it would move the
estimate by any distance, and its velocity with it. The filters of turns are linearised there, and
need not come back.
"""

import math
from collections.abc import Sequence

import numpy as np

from hybrid_env.checks import FloatArray, Moments
from hybrid_env.compiled import compiled
from hybrid_env.options import ModelOptions
from hybrid_env.sensors import velocity_variance_of


def unit_noise(options: ModelOptions) -> FloatArray:
    """Return the covariance xx, xy, yy of a measured position of variance R [m^2]."""
    variances = options.variances
    return np.array([variances[0], 0.0, variances[-1]])


def line_estimate(rows: FloatArray, options: ModelOptions) -> Moments:
    """Fit a straight line to m measurements, rows (m, 6) of tick, x, y [m] and noise xx, xy, yy
    [m^2]. Return estimate and covariance (4, 4) at the last one: of the noise of the measurements,
    of the process noise, and of the turns of the bank, all equally probable. Of a single
    measurement the velocity is 0, with infinite variance.
    """
    ticks = rows[:, 0]
    points = rows[:, 1:3]
    matrices = rows[:, [[3, 4], [4, 5]]]
    if len(rows) == 1:
        x, y = points[0]
        covariance = np.diag([0.0, np.inf, 0.0, np.inf])
        covariance[::2, ::2] = matrices[0]
        return np.array([x, 0.0, y, 0.0]), covariance
    ages = ticks[-1] - ticks
    times = options.tau * ages
    # Of the measurements in the last position and the velocity, by least squares.
    weights = np.linalg.pinv(np.stack([np.ones_like(times), -times], axis=1))
    estimate = (weights @ points).T.ravel()
    # The noise that a velocity gets i ticks before the last measurement has moved the earlier
    # positions.
    moved = weights @ (options.tau * np.maximum(ages[:, None] - np.arange(ages[0]), 0))
    covariance = np.einsum("iab,ci,di->acbd", matrices, weights, weights).reshape(4, 4)
    covariance += np.kron(np.eye(2), options.process_variance * moved @ moved.T)
    velocity = estimate[1::2]
    speed = float(np.hypot(*velocity))
    if speed > 0.0:
        turn_rates = np.minimum(speed / np.array(options.radii), np.pi / options.tau)
        # Mean square.
        acceleration = 2.0 * float(((speed * turn_rates) ** 2).sum()) / options.hypotheses
        bend = weights @ (0.5 * times**2)
        across = np.array([-velocity[1], velocity[0]]) / speed
        covariance += acceleration * np.kron(np.outer(across, across), np.outer(bend, bend))
    return estimate, covariance


class FirstMeasurements:
    """Collects measurements until more of them would not make the estimate of the velocity better.
    The line is fitted to as many of the last ones as give the smallest variance of the velocity:
    few if the object turns by a large angle in a tick, up to `most` if they are noisy. A track can
    begin when it is `complete`. A measured velocity needs no line.
    """

    def __init__(self, options: ModelOptions, most: int):
        self.options = options
        self.most = most
        self.complete = False
        self.estimate: FloatArray = np.full(4, np.nan)
        self.covariance: FloatArray = np.diag(np.full(4, np.inf))
        self._tick = 0
        # Tick, x, y, and the covariance xx, xy, yy.
        self._measured: list[list[float]] = []

    def skip(self) -> None:
        """Advance by one tick without a measurement; the estimate moves on along the line."""
        self._tick += 1
        motion = np.kron(np.eye(2), [[1.0, self.options.tau], [0.0, 1.0]])
        self.estimate = motion @ self.estimate
        # Otherwise a variance is infinite.
        if len(self._measured) > 1:
            process = np.diag([0.0, self.options.process_variance] * 2)
            self.covariance = motion @ self.covariance @ motion.T + process

    def add(
        self,
        x: float,
        y: float,
        noise: Sequence[float] | FloatArray | None = None,
        late: float = 0.0,
        rates: Sequence[float] = (),
    ) -> None:
        """Advance by one tick with a measurement [m], and its covariance xx, xy, yy [m^2]; None
        is R. It was made by `late` after the tick [s]; the estimate is at the tick. With a measured
        velocity as `rates` [m/s] no further measurement is needed.
        """
        self._tick += 1
        variances = unit_noise(self.options) if noise is None else noise
        variance = velocity_variance_of(self.options.sensors)
        if variance is not None and len(rates) == 2 and np.isfinite(rates).all():
            vx, vy = rates
            self.estimate = np.array([x - late * vx, vx, y - late * vy, vy])
            xx, xy, yy = variances
            self.covariance = np.diag([xx, variance, yy, variance])
            self.covariance[0, 2] = self.covariance[2, 0] = xy
            self.complete = True
            return
        self._measured.append([self._tick + late / self.options.tau, x, y, *variances])
        rows = np.array(self._measured)
        counts = range(min(2, len(rows)), len(rows) + 1)
        fits = [line_estimate(rows[-count:], self.options) for count in counts]
        best = int(np.argmin([covariance[1, 1] + covariance[3, 3] for _, covariance in fits]))
        self.estimate, self.covariance = fits[best]
        if late:
            self.estimate[::2] -= late * self.estimate[1::2]
        self.complete = best + 1 < len(fits) or len(rows) >= self.most


@compiled
def gate_distance(
    measurement: FloatArray,
    estimate: FloatArray,
    covariance: FloatArray,
    radii: FloatArray,
    tau: float,
    noise: FloatArray,
    ticks: int,
    stops: bool,
) -> float:
    """Return the distance of a measurement (2,) from the nearest predicted position, in standard
    deviations. Predicted are straight motion, the turns of the bank by no large angle, and with
    `stops` no motion, from an estimate (4,) one tick before, its covariance (4, 4) and that of the
    measurement, `noise`, xx, xy, yy [m^2]. What turns in the `ticks` since the estimate was
    certainly right can have added to the distance from a straight line does not count.
    """
    # Angle in a tick [rad] above which a turn is no explanation of a measurement.
    largest_turn = 1.0
    P = covariance
    xx = P[0, 0] + 2.0 * tau * P[0, 1] + tau * tau * P[1, 1] + noise[0]
    yy = P[2, 2] + 2.0 * tau * P[2, 3] + tau * tau * P[3, 3] + noise[2]
    xy = P[0, 2] + tau * (P[0, 3] + P[1, 2]) + tau * tau * P[1, 3] + noise[1]
    u = tau * estimate[1]
    v = tau * estimate[3]
    step = math.hypot(u, v)
    allowed = 0.0
    if ticks > 1 and radii.size and step <= largest_turn * radii.min():
        path = step * ticks
        allowed = path * min(path / (2.0 * radii.min()), 2.0)
    nearest = math.inf
    # Turns to the right, straight, turns to the left, and a stop.
    for k in range(-radii.size, radii.size + 1 + stops):
        stands = k > radii.size
        angle = 0.0 if stands or k == 0 else math.copysign(step, k) / radii[abs(k) - 1]
        if abs(angle) <= largest_turn:
            along = math.sin(angle) / angle if angle else 1.0 - stands
            across = (1.0 - math.cos(angle)) / angle if angle else 0.0
            dx = measurement[0] - estimate[0] - (along * u - across * v)
            dy = measurement[1] - estimate[2] - (along * v + across * u)
            length = math.hypot(dx, dy)
            left = max(length - allowed, 0.0) / max(length, 1e-300)
            squared = left * left * (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy)
            nearest = min(nearest, squared / (xx * yy - xy * xy))
    return math.sqrt(nearest)
