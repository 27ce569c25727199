"""The options of the model that every environment has, checked on creation."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Interval, Unit

from hybrid_env.checks import AnyArray, Checked, FloatArray, IntArray, Share, reject
from hybrid_env.core.memory import PARAMETERS
from hybrid_env.limits import (
    Quantity,
    QuantityOrZero,
    Ticks,
    axis_variances,
    check_initial_error,
    check_variance_range,
    check_variances,
    distinct_radii,
)
from hybrid_env.modes import Climb, Mode, modes_of_radii, motion_table, parse_modes, radii_of_modes
from hybrid_env.noises import GaussianNoise, Noise, StudentNoise, parse_likelihood, parse_noise
from hybrid_env.sensors import Radar, Sensor, parse_sensors, sensor_table


@dataclass(frozen=True, kw_only=True)
class ModelOptions(Checked):
    """The options of the model that every environment has; each environment has a subclass.

    Values are converted to plain numbers, strings and tuples, so that arrays and lists that are
    given may change later. Allowed are numbers from 1e-18 to 1e18 in any unit, and 1,000 radii; the
    object may turn by 100 rad per tick and move by 10^9 standard deviations of a measurement.

    Attributes:
        radii: turn radii of the bank [m], each to the left and to the right. M = 2 n + 1 hypotheses
            of n radii, the short form of `modes`.
        modes: modes of object and bank, as "straight, left 5, stop", see `hybrid_env.modes`. Also
            "turn rate 0.2", "accelerate 1", or a sequence of names and of mode objects. With them
            `radii` has no effect. None is straight motion and the turns of `radii`. With "climb 5"
            or "descend 5" [m/s] among them a hypothesis is a pair of modes, of the plane and of the
            height, whose first value is 0, measured with an error of its own.
        speed: initial speed of the object [m/s].
        heading: initial heading of the object [rad], counter-clockwise from the x axis. None draws
            a uniform one.
        tau: length of a tick [s].
        process_variance: Q, variance of the noise added to each velocity at every tick [m^2/s^2].
        object_variance: the same of the object, of which the filters are not told. (smallest,
            largest) draws it for every episode, uniform in its logarithm. None is Q.
        drift_variance: variance of the drift of each measured coordinate in a tick [m^2]. The
            anchor-aware and the IMM filters assume it, as of a GPS; measurements have none.
        measurement_variance: R, variance of each measured coordinate [m^2], one number or (x, y).
        climb_variance: variance of the noise added to the vertical rate at every tick [m^2/s^2].
        height_variance: variance of a measured height [m^2], whose errors are normal.
        noise: law of the errors of measurements in units of sqrt(R), as "student_t 3", see
            `hybrid_env.noises`. Also "gaussian", "outliers 0.02", "levy 1.5 1 44", or a law object.
            The bank does not know it.
        missed: probability that a tick has no measurement, below 1. Of each sensor, if there are
            several. The filters then only predict; in the observation all innovations are zero, and
            `info` has no "measurement".
        sensors: position sensors and radars, as "0.4 period 5 range 30 at 10 20" and "radar 5 0.01
            rate 0.3". They are `hybrid_env.Sensor` and `Radar`, replace the one of variance R and
            are fused; a tick in which none measures is like a missed one. R, one number, stays the
            unit of the observation.
        likelihood: law of the innovations that the bank assumes, "gaussian" or "student_t 4". Rules
            with filters of their own assume it too. By Student's t a measurement far from all
            predictions changes little (`core.banks.sensing`).
        initial_error: variance of the first position over R, and of the first velocity [m^2/s^2].
            The errors are normal; 0 starts at the true state.
        decide_every: ticks between two decisions. With announced switches a wait lasts to the next
            multiple of it within the segment, or to the end of the segment, and the first decision
            of a segment comes at that tick; with unknown switches a statement holds for so many
            ticks. It is at most the length of the shortest segment, or of an episode.
    """

    switches: ClassVar[Literal["announced", "unknown"]]
    # Names of what `info` tells of the current tick, in its order.
    tick_names: ClassVar[tuple[str, ...]]
    # Name of what `info` tells of every hypothesis.
    hypothesis_field: ClassVar[str]

    radii: Annotated[tuple[float, ...], distinct_radii] = (5.0,)
    modes: Annotated[str | tuple[Mode | str, ...] | None, parse_modes] = None
    speed: Annotated[Quantity, Unit("m/s")] = 2.0
    heading: Annotated[float, Interval(ge=-1e6, le=1e6), Unit("rad")] | None = None
    tau: Annotated[Quantity, Unit("s")] = 0.1
    process_variance: Annotated[QuantityOrZero, Unit("m^2/s^2")] = 0.001
    object_variance: Annotated[float | tuple[float, float], check_variance_range] | None = None
    drift_variance: Annotated[QuantityOrZero, Unit("m^2")] = 0.0
    measurement_variance: Annotated[float | tuple[float, float], check_variances] = 0.1
    climb_variance: Annotated[QuantityOrZero, Unit("m^2/s^2")] = 0.001
    height_variance: Annotated[Quantity, Unit("m^2")] = 0.1
    noise: Annotated[str | Noise, parse_noise] = "gaussian"
    missed: Share = 0.0
    sensors: Annotated[tuple[Sensor | Radar, ...], parse_sensors] = ()
    likelihood: Annotated[str | GaussianNoise | StudentNoise, parse_likelihood] = "gaussian"
    initial_error: Annotated[float | tuple[float, float], check_initial_error] = (0.3, 0.02)
    decide_every: Ticks = 1

    def __post_init__(self) -> None:
        if self.modes is not None:
            # They are those of the modes, which may have none.
            object.__setattr__(self, "radii", ModelOptions.radii)
        super().__post_init__()
        if self.modes is not None:
            radii = radii_of_modes(self.all_modes)
            standard = bool(radii) and self.all_modes == modes_of_radii(radii)
            object.__setattr__(self, "radii", radii)
            object.__setattr__(self, "modes", None if standard else self.modes)
        if self.sensors and self.variances.size > 1:
            allowed = "one number with sensors, whose variances are the same for both axes"
            raise reject("measurement_variance", self.measurement_variance, allowed)

        if self.sensors and self.climbs:
            raise reject("sensors", self.sensors, "none with modes that climb or descend")

    def _check_ratios(self, radii: Iterable[float]) -> None:
        """Check the ratios of the options, for radii of bank and object [m]."""
        assert isinstance(self.initial_error, tuple)
        pushed = 0.0
        if self.modes is not None:
            # Factors that give the states the tick as their unit of time.
            scales = self.tau ** np.array([0.0, 1.0, 0.0, 1.0, 2.0, 2.0])
            motions = self.motions
            deviations = np.sqrt(np.diagonal(motions["Q"], 0, 1, 2).clip(0.0))
            pushed = (np.maximum(np.abs(motions["B"]), deviations) * scales).max()
            pushed = max(pushed, np.abs(motions["acceleration"]).max() * scales[-1])
            F = motions["F"] * scales[:, None] / scales
            last = self.most_ticks
            for ticks in [*(2**k for k in range(last.bit_length())), last]:
                # A constant acceleration reaches ticks^2 / 2.
                most = max(1e9, float(ticks) ** 2)
                grown = np.abs(np.linalg.matrix_power(F, ticks)).max(axis=(1, 2)) > most
                if grown.any():
                    allowed = "F by whose powers a state, in units of tau, grows at most 1e9 times"
                    name = self.all_modes[grown.argmax()].name
                    raise reject("modes", name, f"{allowed} in an episode")
        # From pi on a turn cannot be told from a slower one.
        smallest = self.speed * self.tau / 100.0
        if smallest > min(radii, default=math.inf):
            allowed = "at most 100 rad per tick (speed * tau / radius)"
            raise reject("radii", min(radii), f"at least {smallest:g}: {allowed}")
        fastest = max(self.process_variance, self.object_variances[1], self.initial_error[1])
        motion = max(self.tau * max(self.speed, math.sqrt(fastest)), pushed)
        motion = max(motion, math.sqrt(self.drift_variance))
        variances = {"measurement_variance": float(self.variances.min())}
        if self.climbs:
            fastest = max(self.climb_variance, (self.motions["climb_rate"] ** 2).max())
            motion = max(motion, self.tau * math.sqrt(fastest))
            variances["height_variance"] = self.height_variance
        # Standard deviations of a measurement in a tick and in a radius; a float64 has 16 digits.
        least = max(motion / 1e9, max(radii, default=0.0) / 1e12) ** 2
        for name, variance in variances.items():
            if variance < least:
                allowed = "the motion per tick and the radii are too many standard deviations"
                raise reject(name, variance, f"at least {least:g}: {allowed}")

    @property
    def action_count(self) -> int:
        """Number of actions."""
        raise NotImplementedError

    @property
    def most_ticks(self) -> int:
        """Length of the longest possible episode [ticks]."""
        raise NotImplementedError

    @property
    def longest_episode(self) -> int:
        """Largest number of steps of an episode."""
        raise NotImplementedError

    @property
    def table(self) -> FloatArray:
        """Segments in order, or the modes to draw from, see `scheme.segment_table`."""
        raise NotImplementedError

    @property
    def hypotheses(self) -> int:
        """M, the number of hypotheses."""
        return len(self.all_modes)

    @property
    def all_modes(self) -> tuple[Mode, ...]:
        """The modes of the hypotheses, also where they are those of `radii`."""
        if self.modes is None:
            return modes_of_radii(self.radii)
        assert not isinstance(self.modes, str)
        return tuple(mode for mode in self.modes if isinstance(mode, Mode))

    @property
    def climbs(self) -> bool:
        """Whether modes say what the height does: the world has three dimensions."""
        return isinstance(self.all_modes[0], Climb)

    @property
    def type_names(self) -> tuple[str, ...]:
        """The types of the modes, in the order of the first mode of each."""
        return tuple(dict.fromkeys(mode.type for mode in self.all_modes))

    @property
    def types(self) -> IntArray:
        """The type of every hypothesis as a place in `type_names`, (M,)."""
        names = self.type_names
        return np.array([names.index(mode.type) for mode in self.all_modes])

    @property
    def motions(self) -> AnyArray:
        """The modes as the kernel reads them, (M,) records `core.memory.MOTION`."""
        return motion_table(self.all_modes, self.tau, self.process_variance, self.drift_variance)

    @property
    def variances(self) -> FloatArray:
        """Measurement variances [m^2]: (1,) if x and y have the same variance, else (2,)."""
        return axis_variances(self.measurement_variance)

    @property
    def object_variances(self) -> tuple[float, float]:
        """Smallest and largest variance of the process noise of an object [m^2/s^2]."""
        flown = self.process_variance if self.object_variance is None else self.object_variance
        return flown if isinstance(flown, tuple) else (flown, flown)

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the errors that filters assume; 0 is normal ones."""
        return self.likelihood.freedom if isinstance(self.likelihood, StudentNoise) else 0.0

    @property
    def start_variances(self) -> FloatArray:
        """Variances of the first estimate [x, vx, y, vy], (4,) [m^2, m^2/s^2]."""
        assert isinstance(self.initial_error, tuple)
        position, velocity = self.initial_error
        x, y = position * np.broadcast_to(self.variances, 2)
        return np.array([x, velocity, y, velocity])

    @property
    def deviation(self) -> float:
        """Standard deviation of a measured coordinate, sqrt(R): geometric mean of the axes [m]."""
        return float(np.exp(0.5 * np.log(self.variances).mean()))

    def arrays(self) -> dict[str, AnyArray]:
        """Return the arrays of the options that the kernel reads; see `core.memory.Arrays`."""
        signed = [mode.signed_radius for mode in self.all_modes]
        return {
            "radii": np.array(self.radii, float),
            "motions": self.motions,
            "curvatures": np.array([1.0 / radius if radius else 0.0 for radius in signed]),
            "types": self.types,
            "sensors": sensor_table(self.sensors, float(self.variances[0])),
            "table": self.table,
            "durations": np.zeros((0, 0)),
        }

    def parameters(self) -> dict[str, Any]:
        """Return the options as fields of the record `core.memory.PARAMETERS`; a number or a flag
        is the field of its name.
        """
        assert isinstance(self.initial_error, tuple)
        assert not isinstance(self.noise, str)
        names = PARAMETERS.names or ()
        plain = {
            name: value
            for name, value in vars(self).items()
            if name in names and isinstance(value, (float, int))
        }
        position, velocity = self.initial_error
        smallest, largest = self.object_variances
        return {
            **plain,
            **self.noise.parameters(),
            "action_count": self.action_count,
            "heading": math.nan if self.heading is None else self.heading,
            "initial_position": position,
            "initial_velocity": velocity,
            "process_deviation": math.sqrt(smallest),
            "process_range": 0.5 * math.log(largest / smallest) if largest > smallest else 0.0,
            "deviation_x": np.sqrt(self.variances[0]),
            "deviation_y": np.sqrt(self.variances[-1]),
            "variance_x": self.variances[0],
            "variance_y": self.variances[-1],
            "height_rows": self.hypotheses * self.climbs,
            "log_noise": np.log(self.variances).mean(),
            "noise_whitener": 1.0 / self.deviation,
            "radii_count": len(self.radii),
            "columns": len(self.radii) + 1,
            "modes": self.hypotheses,
            "type_count": len(self.type_names),
            "axes": self.variances.size,
            "table_rows": len(self.table),
            "sensor_count": len(self.sensors),
            "freedom": self.freedom,
            "irregular": self.missed > 0.0 or bool(self.sensors),
        }
