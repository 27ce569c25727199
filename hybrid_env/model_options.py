"""The options of the object, its measurements and the radii of the bank, common to all environments."""

import dataclasses
import difflib
import functools
import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import axis_variances, check_positive, reject
from hybrid_env.limits import check_initial_error, check_variances, check_within, distinct_radii
from hybrid_env.noises import GaussianNoise, Noise, StudentNoise, parse_likelihood, parse_noise
from hybrid_env.sensors import Sensor, check_sensors, parse_sensors, sensor_table


@dataclass(frozen=True, kw_only=True)
class ModelOptions:
    """The options of the model that every environment has; each environment has a subclass.

    Values are converted to plain numbers, strings and tuples, so that arrays and lists that are given may
    change later. Allowed are radii from 1e-12 to 1e12, speed and tau from 1e-9 to 1e9, standard deviations
    from 1e-9 to 1e9, and 1,000 radii; the object may turn by 100 rad per tick and move by 10^9 standard
    deviations of a measurement (`hybrid_env.limits`).

    Attributes:
        radii: n turn radii of the bank [m], each as a left and as a right turn: M = 2 n + 1 hypotheses.
        speed: initial speed of the object [m/s].
        heading: initial heading of the object [rad], counter-clockwise from the x axis; None draws it
            uniformly.
        tau: length of a tick [s].
        process_variance: Q, variance of the noise added to each velocity at every tick [m^2/s^2].
        measurement_variance: R, variance of each measured coordinate [m^2], one number or (x, y).
        noise: law of the errors of measurements in units of sqrt(R), see `hybrid_env.noises`: "gaussian",
            "outliers 0.02", "levy 1.5 1 44", "student_t 3", or a law object. The bank does not know it.
        missed: probability that a tick has no measurement (of each sensor, if there are several), below 1.
            The filters then only predict; in the observation all innovations are zero, and
            `info["measurement"]` is NaN.
        sensors: position sensors (`hybrid_env.Sensor`) that replace the one of variance R; their
            measurements of a tick are fused, and a tick in which none measures is like a missed one. R stays
            the unit of the observation and of `initial_error`, and is the same for both axes.
        likelihood: law of the innovations that the bank assumes: "gaussian", or "student_t 4" for a robust
            one, by which a measurement far from all predictions changes little (`core.student_bank`).
        initial_error: (position variance of the first estimate / R, its velocity variance [m^2/s^2]) of a
            normal error; 0 starts at the true state.

    Raises:
        ArgumentError: an option has a value that is not allowed.
    """

    radii: tuple[float, ...] = (5.0,)
    speed: float = 2.0
    heading: float | None = None
    tau: float = 0.1
    process_variance: float = 0.001
    measurement_variance: float | tuple[float, float] = 0.1
    noise: str | Noise = "gaussian"
    missed: float = 0.0
    sensors: tuple[Sensor, ...] = ()
    likelihood: str | GaussianNoise | StudentNoise = "gaussian"
    initial_error: float | tuple[float, float] = (0.3, 0.02)

    def __post_init__(self) -> None:
        fix = functools.partial(object.__setattr__, self)
        fix("radii", distinct_radii("radii", self.radii))
        for name in ("speed", "tau", "process_variance"):
            fix(name, check_within(name, getattr(self, name)))
        if self.heading is not None:
            fix("heading", check_within("heading", self.heading))
        fix("measurement_variance", check_variances(self.measurement_variance))
        fix("noise", parse_noise(self.noise))
        fix("missed", check_positive("missed", self.missed, allow_zero=True))
        if self.missed >= 1.0:
            raise reject("missed", self.missed, "a number >= 0 and < 1")
        fix("sensors", parse_sensors(self.sensors))
        fix("likelihood", parse_likelihood(self.likelihood))
        check_sensors(self.sensors, self.variances.tolist())
        fix("initial_error", check_initial_error(self.initial_error))

    @classmethod
    def of(cls, **options: Any) -> Self:
        """Create options from keywords. An unknown name raises a `TypeError` in the words of Python."""
        names = [field.name for field in dataclasses.fields(cls)]
        for name in options:
            if name not in names:
                close = difflib.get_close_matches(name[:40], names, 1)
                hint = f"did you mean {close[0]!r}? " if close else ""
                expected = f"expected one of {', '.join(names)}"
                # libraries that try keywords, such as TorchRL, read these words of Python
                raise TypeError(f"got an unexpected keyword argument {repr(name)[:40]}: {hint}{expected}")
        return cls(**options)

    @property
    def hypotheses(self) -> int:
        """M, the number of hypotheses."""
        return 2 * len(self.radii) + 1

    @property
    def robust(self) -> bool:
        """Whether the bank has a robust likelihood."""
        return isinstance(self.likelihood, StudentNoise)

    @property
    def sensor_table(self) -> NDArray[Any]:
        """The sensors for the kernel, (k,) records `core.records.SENSOR`."""
        return sensor_table(self.sensors, float(self.variances[0]))

    @property
    def variances(self) -> NDArray[np.float64]:
        """Measurement variances [m^2]: (1,) if x and y have the same variance, else (2,)."""
        return axis_variances(self.measurement_variance)

    def model_parameters(self, record_type: np.dtype[Any]) -> NDArray[Any]:
        """Return a (1,) record for the kernel with the fields `core.records.MODEL_FIELDS` of the options."""
        assert isinstance(self.initial_error, tuple)
        record = np.zeros(1, record_type)
        for name in ("tau", "process_variance", "speed", "missed"):
            record[name] = getattr(self, name)
        record["heading"] = math.nan if self.heading is None else self.heading
        record["initial_position"], record["initial_velocity"] = self.initial_error
        record["process_deviation"] = math.sqrt(self.process_variance)
        record["deviation_x"], record["deviation_y"] = np.sqrt(self.variances[[0, -1]])
        record["variance_x"], record["variance_y"] = self.variances[[0, -1]]
        record["log_noise"] = np.log(self.variances).mean()
        record["radii_count"] = len(self.radii)
        assert not isinstance(self.noise, str)
        names = ("noise_law", "noise_shape", "noise_scale", "noise_clip")
        for name, value in zip(names, self.noise.parameters, strict=True):
            record[name] = value
        record["freedom"] = self.likelihood.freedom if isinstance(self.likelihood, StudentNoise) else 0.0
        record["sensor_count"] = len(self.sensors)
        record["irregular"] = self.missed > 0.0 or bool(self.sensors)
        return record
