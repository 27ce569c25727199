"""Position sensors and radars of any accuracy, period and range, whose measurements of a tick
are fused.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval, Unit
from numpy.typing import ArrayLike

from hybrid_env.checks import AnyArray, Checked, FloatArray, Positive, check_array, checked, reject
from hybrid_env.core.memory import MOST_RATES, SENSOR
from hybrid_env.core.polar import (
    BEARING,
    RANGE,
    RANGE_RATE,
    VELOCITY_X,
    VELOCITY_Y,
    Position,
    add_information,
    fused_position,
    position_noise,
    to_position,
)
from hybrid_env.limits import Quantity, Ticks


def check_range(value: Any, name: str = "range") -> float:
    """Return the largest distance [m] at which a sensor measures, which may be infinite."""
    infinite = isinstance(value, float) and value == math.inf
    return math.inf if infinite else checked(name, value, Positive)


@dataclass(frozen=True, kw_only=True)
class _Placed(Checked):
    """Where and when a sensor measures."""

    position: tuple[float, float] = (0.0, 0.0)
    period: Ticks = 1
    range: Annotated[float, check_range] = math.inf

    @property
    def places(self) -> bool:
        """Whether it measures a position."""
        return True

    @property
    def beside(self) -> tuple[tuple[int, float], ...]:
        """What it measures beside a position, a number of `core.polar`, and its deviation."""
        raise NotImplementedError

    @property
    def rates(self) -> int:
        """Number of values that it measures beside a position."""
        return len(self.beside)

    @property
    def values(self) -> int:
        """Number of values that it measures."""
        return 2 * self.places + self.rates


@dataclass(frozen=True, kw_only=True)
class Sensor(_Placed):
    """A sensor that measures the position of the object with an error of its own, and by option its
    velocity, as from speed and course over ground.

    It measures in the ticks 1, 1 + period, 1 + 2 period, ... of an episode in which the object is
    in range.

    Attributes:
        variance: of each measured coordinate [m^2].
        velocity_variance: of each coordinate of the velocity [m^2/s^2]; None measures none.
        position: (x, y) of the sensor [m]; an object starts at (0, 0).
        period: ticks from one measurement to the next.
        range: largest distance of the object at which it is measured [m].
    """

    variance: Annotated[Quantity, Unit("m^2")]
    velocity_variance: Annotated[Quantity, Unit("m^2/s^2")] | None = None

    @property
    def beside(self) -> tuple[tuple[int, float], ...]:
        """See `_Placed`."""
        if self.velocity_variance is None:
            return ()
        deviation = math.sqrt(self.velocity_variance)
        return (VELOCITY_X, deviation), (VELOCITY_Y, deviation)

    def noise(self, x: float, y: float) -> tuple[float, float, float]:
        """Return the covariance xx, xy, yy of a position [m^2]."""
        return self.variance, 0.0, self.variance

    def located(self, values: FloatArray) -> Position:
        """Return a measured (x, y) [m] and its covariance xx, xy, yy [m^2]."""
        return float(values[0]), float(values[1]), self.variance, 0.0, self.variance


@dataclass(frozen=True, kw_only=True)
class Radar(_Placed):
    """A sensor that measures range and bearing of the object, or one of them, and by option its
    range rate (Doppler).

    Both are converted to a position and its covariance, see `hybrid_env.core.polar`.
    The filters are consistent as long as range * bearing_deviation^2, the bend of an arc of the
    length of the bearing error, is smaller than a quarter of the range deviation: the mean squared
    error is then at most 5 % above its covariance, 14 % at half of it and 37 % at all of it.

    Attributes:
        range_deviation: standard deviation of the range [m]; None measures none, as a camera.
        bearing_deviation: of the bearing [rad]; None measures none, as a beacon.
        rate_deviation: of the range rate [m/s]; None measures none.
        position, period, range: see `Sensor`.
    """

    range_deviation: Annotated[Quantity, Unit("m")] | None = None
    bearing_deviation: Annotated[float, Interval(ge=1e-6, le=1.0), Unit("rad")] | None = None
    rate_deviation: Annotated[Quantity, Unit("m/s")] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.range_deviation is None and self.bearing_deviation is None:
            raise reject("range_deviation", None, "a number, or a bearing_deviation")

    @property
    def places(self) -> bool:
        """Whether it measures a position."""
        return self.range_deviation is not None and self.bearing_deviation is not None

    @property
    def beside(self) -> tuple[tuple[int, float], ...]:
        """See `_Placed`."""
        one = {RANGE: self.range_deviation, BEARING: self.bearing_deviation}
        of = ({} if self.places else one) | {RANGE_RATE: self.rate_deviation}
        return tuple((kind, value) for kind, value in of.items() if value is not None)

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations of range [m] and bearing [rad] of one that measures both."""
        if self.range_deviation is None or self.bearing_deviation is None:
            raise reject("radar", str(self), "one that measures range and bearing")
        return self.range_deviation, self.bearing_deviation

    def located(self, values: FloatArray) -> Position:
        """Return the position of a measured (range, bearing, ...) and its covariance; bearings
        start at the x axis.
        """
        distance, bearing = values[:2].tolist()
        x, y, *covariance = to_position(
            distance, math.cos(bearing), math.sin(bearing), *self.deviations
        )
        return self.position[0] + x, self.position[1] + y, *covariance

    def noise(self, x: float, y: float) -> tuple[float, float, float]:
        """Return the covariance xx, xy, yy of a converted position [m^2]."""
        return position_noise(x - self.position[0], y - self.position[1], *self.deviations)

    def scaled(self, length: float, velocity: float) -> "Radar":
        """Return the same radar at the origin, in other units: the scales of lengths and
        velocities.
        """
        rate = None if self.rate_deviation is None else velocity * self.rate_deviation
        distance = length * self.deviations[0]
        return replace(self, position=(0.0, 0.0), range_deviation=distance, rate_deviation=rate)


class Fused(NamedTuple):
    """What sensors measured in a tick."""

    # (x, y) [m]; NaN without one.
    position: tuple[float, float]
    # Xx, xy, yy of its error [m^2]; None is variance R.
    covariance: tuple[float, float, float] | None = None
    # What each sensor measures beside a position, in the order of the list, as range rate or
    # velocity [m/s]; NaN without it.
    rates: tuple[float, ...] = ()


def fuse(sensors: Sequence[Sensor | Radar], values: Mapping[int, ArrayLike]) -> Fused:
    """Return what some of the sensors measured in a tick. values: of each sensor that measured, by
    its place in the list: (x, y), (x, y, vx, vy), (range, bearing), (range, bearing, range rate)
    [m, rad, m/s], or what it measures of these.
    """
    information = (0.0,) * 5
    rates: list[float] = []
    origin = None
    for k, sensor in enumerate(sensors):
        measured = None
        if k in values:
            measured = check_array(f"measurement[{k}]", values[k], (sensor.values,))
            if sensor.places:
                x, y, xx, xy, yy = sensor.located(measured)
                origin = origin or (x, y)
                apart = x - origin[0], y - origin[1]
                information = add_information(information, *apart, (xx, xy, yy))
        beside = [] if measured is None else measured[2 * sensor.places :].tolist()
        rates += beside or [math.nan] * sensor.rates
    if not values or not values.keys() <= set(range(len(sensors))):
        allowed = f"values of some of the {len(sensors)} sensors by their place in the list, from 0"
        raise reject("measurement", dict(values), allowed)
    if origin is None:
        return Fused((math.nan, math.nan), rates=tuple(rates))
    x, y, *covariance = fused_position(information)
    return Fused((origin[0] + x, origin[1] + y), tuple(covariance), tuple(rates))


def parse_sensors(value: Any, name: str = "sensors") -> tuple[Sensor | Radar, ...]:
    """Return the sensors of a list of sensors, mappings or texts. Raises `ArgumentError` for
    other values.
    """
    most = 100
    allowed = (
        f"a list of at most {most}: hybrid_env.Sensor, Radar, mappings, or texts such as "
        "'0.4 period 5 range 30 at 10 20', '0.4 velocity 0.01', 'radar 5 0.01 rate 0.3',"
        " 'radar none 0.01'"
    )
    if not isinstance(value, Sequence) or isinstance(value, (str, bytes)) or len(value) > most:
        raise reject(name, value, allowed)
    sensors = []
    for sensor in value:
        try:
            given = _attributes(sensor) if isinstance(sensor, str) else sensor
            if isinstance(given, Mapping):
                given = (Sensor if "variance" in given else Radar)(**given)
        except (TypeError, ValueError) as error:
            raise reject(name, value, f"{allowed} ({error})") from None
        if not isinstance(given, (Sensor, Radar)):
            raise reject(name, value, allowed)
        sensors.append(given)
    if sum(sensor.rates for sensor in sensors) > MOST_RATES:
        allowed = f"at most {MOST_RATES} numbers beside positions, two for a velocity"
        raise reject(name, value, allowed)
    return tuple(sensors)


def _attributes(text: str) -> dict[str, Any]:
    """Return the attributes of a sensor from a text, see `parse_sensors`."""
    match = re.fullmatch(
        r"(?:(?P<variance>\S+)|radar (?P<range_deviation>\S+) (?P<bearing_deviation>\S+))"
        r"(?: period (?P<period>\S+)| range (?P<range>\S+)| rate (?P<rate_deviation>\S+)"
        r"| velocity (?P<velocity_variance>\S+)| at (?P<x>\S+) (?P<y>\S+))*",
        " ".join(text.split()),
    )
    if match is None:
        raise ValueError(repr(text))
    values: dict[str, Any] = {
        name: int(word) if name == "period" else float(word)
        for name, word in match.groupdict().items()
        if word not in (None, "none")
    }
    if "x" in values:
        values["position"] = values.pop("x"), values.pop("y")
    return values


def velocity_variance_of(sensors: Sequence[Sensor | Radar]) -> float | None:
    """Return the variance of measured velocities [m^2/s^2]; None unless the only sensor measures
    them.
    """
    sensor = sensors[0] if len(sensors) == 1 else None
    return sensor.velocity_variance if isinstance(sensor, Sensor) else None


def sensor_table(sensors: Sequence[Sensor | Radar], variance: float) -> AnyArray:
    """Return (k,) records `SENSOR` for the kernel; variance: R [m^2]."""
    table = np.zeros(len(sensors), SENSOR)
    rates = 0
    for row, sensor in zip(table, sensors, strict=True):
        row["x"], row["y"] = sensor.position
        row["period"] = sensor.period
        row["range"] = sensor.range
        if isinstance(sensor, Sensor):
            row["deviation"] = math.sqrt(sensor.variance)
            row["precision"] = variance / sensor.variance
        elif sensor.places:
            row["deviation"], row["bearing_deviation"] = sensor.deviations
            row["precision"] = variance / row["deviation"] ** 2
        row["places"] = sensor.places
        row["rate_row"] = rates
        row["rates"] = sensor.rates
        for k, (kind, deviation) in enumerate(sensor.beside):
            row["kinds"][k], row["deviations"][k] = kind, deviation
        rates += sensor.rates
    return table
