"""From the coordinates of a sensor to those of the filters, and back."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from baselines.estimation.turns import TurnEstimate
from hybrid_env.checks import LARGEST_NUMBER, FloatArray, Moments, check_array, reject
from hybrid_env.sensors import Fused, Radar, Sensor, fuse, velocity_variance_of

if TYPE_CHECKING:
    from baselines.recordings.projection import Projection


@dataclass(frozen=True, eq=False)
class SensorUnits:
    """Units of the measurements of a live track, and those of its options.

    Estimates are in the units of the measurements, with a projection in metres.
    """

    # Of the options.
    sensors: tuple[Sensor | Radar, ...]
    # Measurements are latitudes and longitudes [deg], which it projects to metres.
    projection: "Projection | None"
    # (4,) of [x, vx, y, vy], from the units of the measurements to those of the options.
    scales: FloatArray
    # (4,) [x, vx, y, vy] of the measurements at time 0 where the options have 0; it moves on with
    # its velocity.
    origin: FloatArray

    @cached_property
    def same(self) -> bool:
        """Whether both are the same."""
        return bool((self.scales == 1.0).all() and not self.origin.any())

    @cached_property
    def moves(self) -> bool:
        """Whether the origin of the options moves."""
        return bool(self.origin[1::2].any())

    @cached_property
    def squares(self) -> FloatArray:
        """Products of the scales, (4, 4), for covariances."""
        return np.outer(self.scales, self.scales)

    @property
    def second(self) -> float:
        """Unit of time of the options in that of the measurements."""
        return float(self.scales[1] / self.scales[0])

    def origin_at(self, time: Any) -> FloatArray:
        """Return where the options have 0 at times (...), (..., 4); (4,) if it does not move."""
        if not self.moves:
            return self.origin
        return self.origin + np.multiply.outer(
            time, self.origin[[1, 1, 3, 3]] * [1.0, 0.0, 1.0, 0.0]
        )

    def measured(self, measurement: Any, time: float, velocity: Any = None) -> Fused | None:
        """Return a checked measurement in the units of the options, None if there is none; with the
        velocity (2,) that was measured with it.
        """
        if velocity is not None:
            fused = self.measured(measurement, time)
            given = check_array("velocity", velocity, (2,), missing=True)
            if velocity_variance_of(self.sensors) is None:
                allowed = "none: the options have no single sensor that measures the velocity"
                raise reject("velocity", velocity, allowed)
            return fused and fused._replace(rates=tuple(self.rates(given).tolist()))
        if measurement is None or isinstance(measurement, Fused):
            return measurement
        if isinstance(measurement, dict):
            scaled = {k: self._of_sensor(k, values) for k, values in measurement.items()}
            return fuse(self.sensors, scaled)
        pair = isinstance(measurement, (tuple, list)) and len(measurement) == 2
        x, y = measurement if pair else check_array("measurement", measurement, (2,), missing=True)
        if x is None or y is None:
            return None
        if not (isinstance(x, float) and isinstance(y, float)):
            # Two floats are checked without an array, which would be slow.
            x, y = check_array("measurement", measurement, (2,), missing=True).tolist()
        if self.projection is not None:
            x, y = self.projection.forward(x, y).tolist()
        # A sum that is not too large is not NaN.
        if not abs(x) + abs(y) <= LARGEST_NUMBER:
            return None
        return self.position((x, y), time)

    def _of_sensor(self, k: int, values: Any) -> Any:
        """Return what a sensor of the options measured in their units."""
        if k not in range(len(self.sensors)):
            # It is refused with all others.
            return values
        sensor = self.sensors[int(k)]
        length, velocity = self.scales[:2].tolist()
        of_radar = [length, 1.0, velocity]
        units = of_radar if isinstance(sensor, Radar) else [length, length, velocity, velocity]
        given = check_array(f"measurement[{k}]", values, (sensor.values,))
        return given * units[: sensor.values]

    def position(self, position: Sequence[float], time: float) -> Fused:
        """Return a position (x, y) that was measured at a time in the units of the options."""
        x, y = position
        if self.same:
            return Fused((x, y))
        length = float(self.scales[0])
        x0, _, y0, _ = self.origin_at(time).tolist()
        return Fused((length * (x - x0), length * (y - y0)))

    def rates(self, values: FloatArray) -> FloatArray:
        """Return range rates (..., 1) or velocities (..., 2) in the units of the options."""
        velocity = self.origin[1::2] if values.shape[-1] == 2 else 0.0
        return np.asarray(self.scales[1] * (values - velocity))

    def at_time(
        self, position: tuple[float, float], time: float, now: float
    ) -> tuple[float, float]:
        """Return a position in the units of the options at a time as it is at another one, when
        their origin has moved on.
        """
        if not self.moves:
            return position
        dx, dy = ((time - now) * self.scales[::2] * self.origin[1::2]).tolist()
        return position[0] + dx, position[1] + dy

    def start(self, estimate: FloatArray, covariance: FloatArray, time: float) -> Moments:
        """Return an estimate (4,) at a time and its covariance (4, 4) in the units of the
        options.
        """
        return (estimate - self.origin_at(time)) * self.scales, covariance * self.squares

    def moments(self, estimates: FloatArray, covariances: FloatArray, time: Any) -> Moments:
        """Return estimates (..., 4) at times (...) and covariances (..., 4, 4) in the units of the
        measurements.
        """
        if self.same:
            return estimates, covariances
        return estimates / self.scales + self.origin_at(time), covariances / self.squares

    def turn(self, turn: TurnEstimate) -> TurnEstimate:
        """Return a turn in the units of the measurements."""
        length, velocity = self.scales[:2].tolist()
        of_speed = turn.speed / velocity, turn.speed_deviation / velocity
        return TurnEstimate(*of_speed, turn.radius / length, turn.radius_deviation / length)

    def place(self, estimate: FloatArray) -> tuple[float, float]:
        """Return the position of an estimate (4,) as the sensor measures it."""
        x, _, y, _ = estimate.tolist()
        if self.projection is None:
            return x, y
        latitude, longitude = self.projection.inverse(x, y).tolist()
        return latitude, longitude
