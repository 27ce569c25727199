"""Position sensors of different variance, rate and range, whose measurements of a tick are fused."""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import ArgumentError, check_number, reject
from hybrid_env.core.records import SENSOR
from hybrid_env.limits import RANGES, check_ticks, check_within, two_values

MOST_SENSORS = 100
LARGEST_VARIANCE_RATIO = 1e12  # variance of a sensor over R, and R over it
GRAMMAR = (
    f"a list of at most {MOST_SENSORS} sensors: hybrid_env.Sensor, mappings of its attributes, or texts such "
    "as '0.4 period 5 range 30 at 10 20'"
)


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A sensor that measures the position of the object with an error of its own.

    It measures in the ticks 1, 1 + period, 1 + 2 period, ... of an episode in which the object is in range.

    Attributes:
        variance: of each measured coordinate [m^2].
        position: (x, y) of the sensor [m]; an object starts at (0, 0).
        period: ticks from one measurement to the next.
        range: largest distance of the object at which it is measured [m].

    Raises:
        ArgumentError: an attribute has a value that is not allowed.
    """

    variance: float
    position: tuple[float, float] = (0.0, 0.0)
    period: int = 1
    range: float = math.inf

    def __post_init__(self) -> None:
        fix = functools.partial(object.__setattr__, self)
        fix("variance", check_within("variance", self.variance, "measurement_variance"))
        x, y = two_values("position", self.position, "(x, y)")
        fix("position", (check_number("position", x), check_number("position", y)))
        if max(map(abs, self.position)) > RANGES["radii"][1]:
            raise reject("position", self.position, f"numbers up to {RANGES['radii'][1]:g}")
        fix("period", check_ticks("period", self.period))
        allowed = "a number > 0, or inf"
        infinite = isinstance(self.range, float) and self.range == math.inf
        fix("range", math.inf if infinite else check_number("range", self.range, allowed))
        if self.range <= 0.0:
            raise reject("range", self.range, allowed)


def parse_sensors(value: Any) -> tuple[Sensor, ...]:
    """Return the sensors of a list of sensors, mappings or texts. Raises `ArgumentError` for other values."""
    listed = isinstance(value, Sequence) and not isinstance(value, (str, bytes))
    if not listed or len(value) > MOST_SENSORS:
        raise reject("sensors", value, GRAMMAR)
    sensors = []
    for one in value:
        if isinstance(one, (Mapping, str)):
            try:
                one = Sensor(**(_attributes(one) if isinstance(one, str) else one))
            except (ArgumentError, TypeError, ValueError) as error:
                raise reject("sensors", value, f"{GRAMMAR} ({error})") from None
        if not isinstance(one, Sensor):
            raise reject("sensors", value, GRAMMAR)
        sensors.append(one)
    return tuple(sensors)


def _attributes(text: str) -> dict[str, Any]:
    """Return the attributes of a sensor from "VARIANCE [period TICKS] [range DISTANCE] [at X Y]"."""
    words = text.split()
    found: dict[str, Any] = {"variance": float(words.pop(0))} if words else {}
    while words:
        name = words.pop(0)
        if name == "at" and len(words) >= 2:
            found["position"] = float(words.pop(0)), float(words.pop(0))
        elif name in ("period", "range") and words:
            found[name] = (int if name == "period" else float)(words.pop(0))
        else:
            raise ValueError(f"{name!r} in {text!r}")
    return found


def check_sensors(sensors: Sequence[Sensor], variances: Sequence[float]) -> None:
    """Check the sensors against the measurement variances of the axes [m^2].

    Raises:
        ArgumentError: R differs between the axes, or a variance is too different from R.
    """
    if not sensors:
        return
    if len(variances) > 1:
        allowed = "one number with sensors, whose variances are the same for both axes"
        raise reject("measurement_variance", tuple(variances), allowed)
    for sensor in sensors:
        ratio = sensor.variance / variances[0]
        if not 1.0 / LARGEST_VARIANCE_RATIO <= ratio <= LARGEST_VARIANCE_RATIO:
            allowed = f"variances within a factor {LARGEST_VARIANCE_RATIO:g} of measurement_variance"
            raise reject("sensors", sensor.variance, allowed)


def sensor_table(sensors: Sequence[Sensor], variance: float) -> NDArray[Any]:
    """Return (k,) records `SENSOR` for the kernel.

    Args:
        sensors: k sensors.
        variance: R [m^2].
    """
    table = np.zeros(len(sensors), SENSOR)
    for row, sensor in zip(table, sensors, strict=True):
        row["x"], row["y"] = sensor.position
        row["deviation"] = math.sqrt(sensor.variance)
        row["precision"] = variance / sensor.variance
        row["period"], row["range"] = sensor.period, sensor.range
    return table
