"""Schemes: the mode, length and radius of every segment of a trajectory.

A scheme is written as in the papers, one word per segment: "L50r3 R75r5 S50" is a left turn of 50 ticks with
a radius of 3 m, a right turn of 75 ticks with a radius of 5 m, and a straight line of 50 ticks.
"""

import re
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_env.checks import check_integer, check_radii, reject
from hybrid_env.core.records import SEGMENT_COLUMNS

MAX_LENGTH = 1_000_000  # ticks per segment, and segments per scheme
GRAMMAR = (
    "words such as 'S50', 'L50r3' or 'R75r5' (mode, ticks >= 1, radius > 0 for a turn), "
    "'random', 'random 6x50-100' (segments x ticks), or a key of hybrid_env.SCHEMES"
)

_SEGMENT = re.compile(r"([SLR])(\d+)(?:r(\d+(?:\.\d*)?|\.\d+))?")
_RANDOM = re.compile(r"random(?:\s+(\d+)x(\d+)(?:-(\d+))?)?")


@dataclass(frozen=True)
class Segment:
    """One segment of a trajectory.

    Attributes:
        mode: "S" straight, "L" left turn, "R" right turn.
        length: length [ticks], at least 1.
        radius: turn radius [m]; None for a straight segment.

    Raises:
        ArgumentError: an attribute has a value that is not allowed.
    """

    mode: str
    length: int
    radius: float | None = None

    def __post_init__(self) -> None:
        if self.mode not in ("S", "L", "R"):
            raise reject("mode", self.mode, "'S', 'L' or 'R'")
        check_integer("length", self.length)
        if self.length > MAX_LENGTH:
            raise reject("length", self.length, f"at most {MAX_LENGTH} ticks")
        if (self.mode == "S") != (self.radius is None):
            raise reject("radius", self.radius, "None for a straight segment, a number > 0 for a turn")
        if self.radius is not None:
            check_radii("radius", self.radius)

    @property
    def signed_radius(self) -> float:
        """Turn radius [m], positive to the left, negative to the right, 0 if straight."""
        return 0.0 if self.radius is None else self.radius if self.mode == "L" else -self.radius

    def __str__(self) -> str:
        return f"{self.mode}{self.length}" + ("" if self.radius is None else f"r{self.radius:g}")


@dataclass(frozen=True)
class FixedScheme:
    """A scheme with the same segments in every episode.

    Attributes:
        pieces: the segments in order.
    """

    pieces: tuple[Segment, ...]

    def __post_init__(self) -> None:
        if not self.pieces:
            raise reject("scheme", self.pieces, "at least one segment")

    def __str__(self) -> str:
        return " ".join(map(str, self.pieces))


@dataclass(frozen=True)
class RandomScheme:
    """A scheme with random segments in every episode. Modes are independent and equally likely.

    Attributes:
        segments: number of segments.
        lengths: (shortest, longest) length [ticks]; lengths are uniform and include both limits.
        radii: turn radii of the object [m]; None uses the radii of the bank.

    Raises:
        ArgumentError: an attribute has a value that is not allowed.
    """

    segments: int = 6
    lengths: tuple[int, int] = (50, 100)
    radii: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        check_integer("segments", self.segments)
        if self.segments > MAX_LENGTH:
            raise reject("segments", self.segments, f"at most {MAX_LENGTH}")
        if len(self.lengths) != 2:
            raise reject("lengths", self.lengths, "(shortest, longest)")
        shortest, longest = self.lengths
        check_integer("lengths", shortest)
        check_integer("lengths", longest)
        if shortest > longest or longest > MAX_LENGTH:
            raise reject("lengths", self.lengths, f"1 <= shortest <= longest <= {MAX_LENGTH}")
        if self.radii is not None:
            check_radii("radii", self.radii)

    def __str__(self) -> str:
        return f"random {self.segments}x{self.lengths[0]}-{self.lengths[1]}"


Scheme: TypeAlias = FixedScheme | RandomScheme

SCHEMES = {
    "golubkov2018": "L50r3 R75r5 S50 L75r3 S50 L60r4",
    "tsyganov2019": "S250 R314r5 S250 L314r5 S250 L314r5 S250 L314r5 S250",
    "golubkov2020": "S20 R20r5",
}
"""The schemes of the papers: Golubkov 2018, table 1; Tsyganov 2019, example 1; Golubkov 2020."""


def parse_scheme(value: "str | Scheme") -> Scheme:
    """Parse a string; a scheme object is returned as it is. Raises `ArgumentError` for other values."""
    if isinstance(value, (FixedScheme, RandomScheme)):
        return value
    if not isinstance(value, str) or not value.strip():
        raise reject("scheme", value, GRAMMAR)
    text = SCHEMES.get(value.strip(), value.strip())
    random = _RANDOM.fullmatch(text)
    if random:
        if random[1] is None:
            return RandomScheme()
        shortest = int(random[2])
        return RandomScheme(int(random[1]), (shortest, int(random[3] or shortest)))
    pieces = []
    for word in re.split(r"[\s,;]+", text):
        match = _SEGMENT.fullmatch(word)
        if not match or (match[1] == "S") != (match[3] is None):
            raise reject("scheme", value, GRAMMAR + f"; invalid word {word!r}")
        try:
            pieces.append(Segment(match[1], int(match[2]), float(match[3]) if match[3] else None))
        except ValueError as error:
            raise reject("scheme", value, f"{GRAMMAR}; invalid word {word!r}: {error}") from None
    return FixedScheme(tuple(pieces))


def nearest_mode(signed_radius: float, radii: ArrayLike) -> int:
    """Return the index of the hypothesis on the same side with the closest curvature; 0 is straight."""
    if signed_radius == 0.0:
        return 0
    bank: NDArray[np.float64] = np.asarray(radii, dtype=np.float64)
    nearest = int(np.abs(1.0 / bank - 1.0 / abs(signed_radius)).argmin())
    return 1 + nearest + (bank.size if signed_radius < 0 else 0)


def segment_table(scheme: Scheme, radii: ArrayLike) -> NDArray[np.float64]:
    """Return the segment table, (segments, columns), with columns `core.records.SEGMENT_COLUMNS`.

    A fixed scheme has one row per segment. A random scheme has one row per mode, with length 0; the rows are
    equally likely.
    """
    bank = np.asarray(radii, dtype=np.float64)
    if isinstance(scheme, FixedScheme):
        segments = [{"signed_radius": piece.signed_radius, "length": piece.length} for piece in scheme.pieces]
    else:
        own = bank if scheme.radii is None else np.asarray(scheme.radii)
        segments = [{"signed_radius": signed, "length": 0} for signed in (0.0, *own, *-own)]
    for segment in segments:
        segment["mode"] = nearest_mode(segment["signed_radius"], bank)
    return np.array([[float(segment[name]) for name in SEGMENT_COLUMNS] for segment in segments])
