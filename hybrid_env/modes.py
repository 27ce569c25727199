"""Modes of motion of the user's own, for the option `modes` of every environment.

    modes=(Straight(), Turn(5.0), Turn(-5.0), Stop())
    modes="straight, left 5, right 5, stop"

A mode says how the state of an object changes in a tick, x' = F x + B + w with w ~ N(0, Q). The
state is [x, vx, y, vy], or with accelerations [x, vx, ax, y, vy, ay] [m, m/s, m/s^2]; the position
is measured. A mode of the user is a `LinearMode`, or a subclass of `Mode` with `matrices`. Modes of
one type, such as all left turns, count as one with `correctness="type"`.

    modes="straight, left 900, right 900, climb 5, descend 5"

With climbs a hypothesis is a pair of a mode of the plane and of one of the height: here nine,
"straight level", "straight climb 5", ..., "right 900 descend 5".
"""

import functools
import math
import re
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Interval, Unit

from hybrid_env.checks import AnyArray, Checked, FloatArray, check_array, check_covariance, reject
from hybrid_env.core.memory import MOTION, MOTION_STATES

Matrices = tuple[FloatArray, FloatArray, FloatArray | None]
Nonzero = Annotated[float, Interval(ge=-1e18, le=1e18)]

# Places of [x, vx, y, vy], and of [x, vx, ax, y, vy, ay], in the order of the compiled core.
PLACES = {4: (0, 1, 2, 3), MOTION_STATES: (0, 1, 4, 2, 3, 5)}


@dataclass(frozen=True)
class Mode(Checked, ABC):
    """A mode of motion. A subclass has `matrices`; turns of a radius and accelerations along the
    heading depend also on the velocity at the switch.
    """

    # The words that name it in a text, in front of the numbers of its fields: those of its class.
    words: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        if "words" not in vars(cls):
            cls.words = re.sub("(?<!^)([A-Z])", r" \1", cls.__name__).lower()

    @property
    def name(self) -> str:
        """Name in the text of an option."""
        values = (getattr(self, field.name) for field in fields(self))
        numbers = (f"{value:.15g}" for value in values if isinstance(value, (int, float)))
        return " ".join([self.words, *numbers])

    @property
    def label(self) -> str:
        """Name in tables and figures."""
        return self.name

    @property
    def type(self) -> str:
        """What the mode is if its numbers do not count, see `correctness`."""
        return self.words

    @property
    def signed_radius(self) -> float:
        """Radius of a turn [m], positive to the left; 0 if the mode is not a turn of a radius."""
        return 0.0

    @property
    def starting_acceleration(self) -> float:
        """Acceleration along the heading at the switch [m/s^2]."""
        return 0.0

    @property
    def planar(self) -> "Mode":
        """The mode of the plane, without what the height does."""
        return self

    @abstractmethod
    def matrices(self, tau: float) -> Matrices:
        """Return F (n, n), B (n,) and Q (n, n) of a tick of length tau [s], for n = 4 or 6 states.
        Q = None is the noise of the option `process_variance` on each velocity.
        """

    def __str__(self) -> str:
        return self.name

    def as_json(self) -> Any:
        """Return what `parse_modes` reads, for files that name the options; warn if no text names
        the mode.
        """
        if type(mode_of_text(self.name)) is not type(self):
            warnings.warn(f"mode {self.name!r} has no text: a file has its name only", stacklevel=2)
        return self.name


@dataclass(frozen=True)
class Straight(Mode):
    """Motion with a constant velocity."""

    @property
    def label(self) -> str:
        """See `Mode.label`."""
        return "S"

    def matrices(self, tau: float) -> Matrices:
        """See `Mode.matrices`."""
        return constant_acceleration(tau), np.zeros(MOTION_STATES), None


@dataclass(frozen=True)
class Stop(Mode):
    """The object stands. Its velocity in the state is that with which it moves on."""

    def matrices(self, tau: float) -> Matrices:
        """See `Mode.matrices`."""
        return np.eye(4), np.zeros(4), None


@dataclass(frozen=True)
class Turn(Mode):
    """A turn of a radius about a fixed centre, with the turn rate speed / radius at the switch.
    Golubkov 2018, eq. (1).

    Attributes:
        radius: turn radius [m], positive to the left and negative to the right.
    """

    radius: Annotated[Nonzero, Unit("m")]

    def __post_init__(self) -> None:
        super().__post_init__()
        if abs(self.radius) < 1e-18:
            raise reject("radius", self.radius, "a number of a magnitude from 1e-18 to 1e18 [m]")

    @property
    def name(self) -> str:
        """See `Mode.name`."""
        return f"{self.type} {abs(self.radius):.15g}"

    @property
    def label(self) -> str:
        """See `Mode.label`."""
        return f"{self.type[0].upper()} r={abs(self.radius):g} m"

    @property
    def type(self) -> str:
        """The side of the turn."""
        return side(self.radius)

    @property
    def signed_radius(self) -> float:
        """See `Mode.signed_radius`."""
        return self.radius

    def matrices(self, tau: float) -> Matrices:
        """See `Mode.matrices`: without the turn, which depends on the heading at the switch."""
        return Straight().matrices(tau)


@dataclass(frozen=True)
class TurnRate(Mode):
    """A coordinated turn of a known turn rate: the velocity turns, whatever the speed.

    Attributes:
        rate: turn rate [rad/s], positive to the left.
    """

    rate: Annotated[Nonzero, Unit("rad/s")]

    @property
    def type(self) -> str:
        """The side of the turn."""
        return side(self.rate)

    def matrices(self, tau: float) -> Matrices:
        """See `Mode.matrices`. Bar-Shalom, Li & Kirubarajan 2001, eq. (11.7.1-4)."""
        angle = self.rate * tau
        along = tau * np.sinc(angle / math.pi)
        across = tau * math.sin(0.5 * angle) * np.sinc(0.5 * angle / math.pi)
        C, S = math.cos(angle), math.sin(angle)
        F = [
            [1.0, along, 0.0, -across],
            [0.0, C, 0.0, -S],
            [0.0, across, 1.0, along],
            [0.0, S, 0.0, C],
        ]
        return np.array(F), np.zeros(4), None


@dataclass(frozen=True)
class Accelerate(Mode):
    """A constant acceleration along the heading at the switch.

    Attributes:
        acceleration: of the speed [m/s^2]; a negative one brakes.
    """

    acceleration: Annotated[Nonzero, Unit("m/s^2")]

    @property
    def type(self) -> str:
        """Whether the object gets faster or slower."""
        return "brake" if self.acceleration < 0.0 else "accelerate"

    @property
    def starting_acceleration(self) -> float:
        """See `Mode.starting_acceleration`."""
        return self.acceleration

    def matrices(self, tau: float) -> Matrices:
        """See `Mode.matrices`."""
        return Straight().matrices(tau)


@dataclass(frozen=True)
class Stopping(Mode):
    """The object slows down to a stop: its velocity decays exponentially.

    Attributes:
        time: in which the speed falls by a factor of e [s].
    """

    time: Annotated[float, Interval(gt=0.0, le=1e18), Unit("s")]

    @property
    def label(self) -> str:
        """See `Mode.label`."""
        return self.type

    @property
    def type(self) -> str:
        """See `Mode.type`."""
        return Stop.words

    def matrices(self, tau: float) -> Matrices:
        """See `Mode.matrices`."""
        left = math.exp(-tau / self.time)
        axis = [[1.0, self.time * (1.0 - left)], [0.0, left]]
        return np.kron(np.eye(2), np.array(axis)), np.zeros(4), None


@dataclass(frozen=True)
class LinearMode(Mode):
    """A linear mode x' = F x + B + w, w ~ N(0, Q), of the state [x, vx, y, vy] or [x, vx, ax, y,
    vy, ay]. The accelerations are 0 at a switch.

    Attributes:
        F: transition matrix of a tick, (n, n), n = 4 or 6.
        B: constant input of a tick, (n,); None is none.
        Q: covariance of the process noise of a tick, (n, n); None is the noise of the option
            `process_variance` on each velocity.
        name: name of the mode, which is also its type.
    """

    F: Any
    B: Any = None
    Q: Any = None
    name: str = "linear"

    def __post_init__(self) -> None:
        F = check_array("F", self.F, (None, None))
        n = len(F)
        if n not in PLACES or F.shape != (n, n):
            raise reject("F", self.F, f"(4, 4) or (6, 6) numbers, not {F.shape}")
        given = {"F": F, "B": np.zeros(n), "Q": None}
        if self.B is not None:
            given["B"] = check_array("B", self.B, (n,))
        if self.Q is not None:
            Q = check_array("Q", self.Q, (n, n))
            given["Q"] = check_covariance("Q", Q, definite=False)
        for name, array in given.items():
            # Modes are compared by their numbers.
            object.__setattr__(self, name, None if array is None else as_tuples(array))
        if not isinstance(self.name, str) or not re.fullmatch(
            r"[a-z][^,;\s]*( [^,;\s]+)*", self.name
        ):
            raise reject(
                "name", self.name, "words without commas, the first of which begins a to z"
            )

    @property
    def type(self) -> str:
        """The name of the mode."""
        return self.name

    def matrices(self, tau: float) -> Matrices:
        """See `Mode.matrices`."""
        return np.array(self.F), np.array(self.B), None if self.Q is None else np.array(self.Q)

    def as_json(self) -> Any:
        """See `Mode.as_json`."""
        return asdict(self)


@dataclass(frozen=True)
class Climb(Mode):
    """A vertical rate that the object has from the switch on, and its mode in the plane.

    Attributes:
        rate: vertical rate [m/s]; a negative one descends, 0 is level.
        plane: mode of the plane; None is every one of the option `modes`, which then has a mode for
            each of its modes of the plane and each rate, 0 first.
    """

    rate: Annotated[float, Interval(ge=-1e18, le=1e18), Unit("m/s")]
    plane: Mode | None = None

    @property
    def _side(self) -> str:
        return "climb" if self.rate > 0.0 else "descend" if self.rate else "level"

    @property
    def planar(self) -> Mode:
        """See `Mode.planar`."""
        return self.plane or Straight()

    @property
    def name(self) -> str:
        """See `Mode.name`."""
        rate = f" {abs(self.rate):.15g}" if self.rate else ""
        return f"{self.planar.name} {self._side}{rate}"

    @property
    def type(self) -> str:
        """The types of both."""
        return f"{self.planar.type} {self._side}"

    @property
    def signed_radius(self) -> float:
        """See `Mode.signed_radius`."""
        return self.planar.signed_radius

    @property
    def starting_acceleration(self) -> float:
        """See `Mode.starting_acceleration`."""
        return self.planar.starting_acceleration

    def matrices(self, tau: float) -> Matrices:
        """See `Mode.matrices`: those of the plane."""
        return self.planar.matrices(tau)


def as_tuples(array: FloatArray) -> tuple[Any, ...]:
    """Return the numbers of a vector, or the rows of a matrix."""
    numbers: list[Any] = array.tolist()
    return tuple(tuple(row) if isinstance(row, list) else row for row in numbers)


def side(number: float) -> str:
    """Return the side of a turn of a signed radius or rate."""
    return "left" if number > 0.0 else "right"


def constant_acceleration(tau: float) -> FloatArray:
    """Return F (6, 6) of motion with a constant acceleration in a tick of length tau [s]."""
    axis = [[1.0, tau, 0.5 * tau * tau], [0.0, 1.0, tau], [0.0, 0.0, 1.0]]
    return np.kron(np.eye(2), np.array(axis))


@functools.lru_cache(maxsize=64)
def modes_of_radii(radii: tuple[float, ...]) -> tuple[Mode, ...]:
    """Return the modes of the option `radii`: straight, left turns, right turns."""
    return (Straight(), *map(Turn, radii), *(Turn(-radius) for radius in radii))


def radii_of_modes(modes: Iterable[Mode]) -> tuple[float, ...]:
    """Return the radii of all turns [m]."""
    return tuple(dict.fromkeys(abs(mode.signed_radius) for mode in modes if mode.signed_radius))


def parse_modes(value: Any, name: str = "modes") -> tuple[Mode, ...] | None:
    """Return modes of a text, or of a sequence of modes, texts, and mappings with the fields of a
    `LinearMode`. Raises `ArgumentError` for other values.
    """
    if value is None:
        return None
    modes: list[Mode] = []
    parts = [part.strip() for part in value.split(",")] if isinstance(value, str) else value
    most_modes = 1000
    for part in parts[: most_modes + 1] if isinstance(parts, (tuple, list)) else [value]:
        mode = mode_of(part)
        if mode is None:
            allowed = (
                "modes of hybrid_env.modes, or their names: 'straight', 'left 5', 'right 5',"
                " 'stop', 'stopping 2', 'accelerate 0.5', 'turn rate 0.2', 'climb 5'"
            )
            raise reject(name, part, allowed)
        modes.append(mode)
    climbs = [mode for mode in modes if isinstance(mode, Climb)]
    if climbs:
        rates = dict.fromkeys([0.0, *(mode.rate for mode in climbs if mode.plane is None)])
        planes = [mode for mode in modes if not isinstance(mode, Climb)]
        modes = [Climb(rate, plane) for plane in planes for rate in rates]
        modes += (mode for mode in climbs if mode.plane)
    names = [mode.name for mode in modes]
    if not 2 <= len(modes) <= most_modes or len({*names}) < len(modes):
        raise reject(name, names, f"2 to {most_modes:,} modes of different names")
    return tuple(modes)


def planar_modes(value: Any, name: str = "modes") -> tuple[Mode, ...] | None:
    """Return what `parse_modes` does, of modes that neither climb nor descend."""
    modes = parse_modes(value, name)
    if modes and isinstance(modes[0], Climb):
        raise reject(name, value, "modes of the plane")
    return modes


def mode_of(value: Any) -> Mode | None:
    """Return a mode, or that of a text or of a mapping; None if there is none."""
    if isinstance(value, Mapping):
        with suppress(TypeError):
            return LinearMode(**value)
    return value if isinstance(value, Mode) else mode_of_text(value)


def mode_of_text(text: Any) -> Mode | None:
    """Return the mode of a text; None if there is none of this name."""
    words = " ".join(text.split()) if type(text) is str else ""
    if match := re.fullmatch(r"(.*?) ?\b(?:level|(climb|descend) ?([-+\d.]\S*))", words):
        with suppress(ValueError):
            plane, rate = mode_of_text(match[1]), float(match[3] or 0.0)
            if plane or not match[1]:
                return Climb(-rate if match[2] == "descend" else rate, plane)
        return None
    match = re.fullmatch(r"([a-z]+(?: [a-z]+)*) ?([-+\d.]\S*)?", words)
    if match is None:
        return None
    try:
        numbers = [float(match[2])] if match[2] else []
        if match[1] in ("left", "right"):
            return Turn(*(number if match[1] == "left" else -number for number in numbers))
        kinds: tuple[type[Mode], ...] = (Straight, Stop, Stopping, TurnRate, Accelerate)
        return next(kind(*numbers) for kind in kinds if kind.words == match[1])
    except (StopIteration, TypeError, ValueError):
        return None


def motion_table(
    modes: Sequence[Mode], tau: float, process_variance: float, drift_variance: float = 0.0
) -> AnyArray:
    """Return the modes as records `core.memory.MOTION`, (M,), for ticks of length tau [s], the
    variance of the process noise on each velocity [m^2/s^2], and that of the drift of the measured
    positions [m^2], of which the object has none.
    """
    table = np.zeros(len(modes), MOTION)
    for motion, mode in zip(table, modes, strict=True):
        try:
            # Checked as those of a user.
            F, B, Q = LinearMode(*mode.matrices(tau)).matrices(tau)
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            raise reject("modes", mode.name, f"matrices F, B and Q of a tick ({reason})") from None
        places = PLACES[len(F)]
        square = np.ix_(places, places)
        motion["signed_radius"] = mode.signed_radius
        motion["acceleration"] = mode.starting_acceleration
        motion["climb_rate"] = mode.rate if isinstance(mode, Climb) else 0.0
        motion["linear"] = not isinstance(mode.planar, (Straight, Turn))
        motion["stands"] = isinstance(mode.planar, Stop)
        motion["F"][square] = F
        motion["B"][list(places)] = B
        if Q is None:
            motion["Q"][[1, 3], [1, 3]] = process_variance
        else:
            motion["Q"][square] = Q
            values, vectors = np.linalg.eigh(motion["Q"])
            motion["own_noise"] = True
            motion["noise"] = vectors * np.sqrt(values.clip(0.0))
        motion["Q"][[0, 2], [0, 2]] += drift_variance
    return table
