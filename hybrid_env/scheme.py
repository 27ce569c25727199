"""Schemes: the mode, length and radius of every segment of a trajectory. A scheme is written as in
the papers, one word per segment: "L50r3 R75r5 S50" is a left turn of 50 ticks with a radius of 3 m,
a right turn of 75 ticks with a radius of 5 m, and a straight line of 50 ticks. "random 6x50-100
radii 3 4" has six random segments, with turns of these radii. With modes of the user a segment is
its length and the name of its mode: "50 straight, 30 stop, 40 left 5".
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

import numpy as np
from annotated_types import Len

from hybrid_env.checks import Checked, FloatArray, checked, reject, unknown
from hybrid_env.limits import Quantity, Ticks, distinct_radii
from hybrid_env.modes import Mode, Straight, Turn, mode_of_text, modes_of_radii, radii_of_modes

MOST_PIECES = 10_000


@dataclass(frozen=True)
class Segment(Checked):
    """One segment of a trajectory.

    Attributes:
        mode: "S" straight, "L" left turn, "R" right turn, or the name of a mode of the user.
        length: length [ticks], at least 1.
        radius: turn radius [m]; None for all but turns.
    """

    mode: str
    length: Ticks
    radius: Quantity | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.mode in ("L", "R")) != (self.radius is not None):
            raise reject(
                "radius", self.radius, "None for a straight segment, a number > 0 for a turn"
            )

    @property
    def name(self) -> str:
        """Name of the mode, see `hybrid_env.modes`."""
        if self.radius is not None:
            return Turn(self.signed_radius).name
        return Straight().name if self.mode == "S" else self.mode

    @property
    def signed_radius(self) -> float:
        """Turn radius [m], positive to the left, negative to the right, 0 if straight."""
        return 0.0 if self.radius is None else self.radius if self.mode == "L" else -self.radius

    def __str__(self) -> str:
        if self.mode not in ("S", "L", "R"):
            return f"{self.length} {self.mode}"
        radius = "" if self.radius is None else f"r{self.radius!r}".removesuffix(".0")
        return f"{self.mode}{self.length}{radius}"


@dataclass(frozen=True)
class FixedScheme(Checked):
    """A scheme with the same segments in every episode: a tuple of at most 10,000 pieces."""

    pieces: Annotated[tuple[Segment, ...], Len(1, MOST_PIECES)]

    def __str__(self) -> str:
        named = any(piece.mode not in ("S", "L", "R") for piece in self.pieces)
        return (", " if named else " ").join(map(str, self.pieces))


def check_lengths(value: Any, name: str = "lengths") -> tuple[int, int]:
    """Return the shortest and the longest of two lengths [ticks]."""
    shortest, longest = checked(name, value, tuple[Ticks, Ticks])
    if shortest > longest:
        raise reject(name, value, "(shortest, longest)")
    return shortest, longest


@dataclass(frozen=True)
class RandomScheme(Checked):
    """A scheme with random segments in every episode. Modes are independent and equally likely.

    Attributes:
        segments: number of segments.
        lengths: (shortest, longest) length [ticks]; lengths are uniform and include both limits.
        radii: turn radii of the object [m]; None uses the radii of the bank.
    """

    segments: Ticks = 6
    lengths: Annotated[tuple[int, int], check_lengths] = (50, 100)
    radii: Annotated[tuple[float, ...], distinct_radii] | None = None

    def __str__(self) -> str:
        lengths = f"random {self.segments}x{self.lengths[0]}-{self.lengths[1]}"
        if self.radii is None:
            return lengths
        return f"{lengths} radii {' '.join(f'{radius:.15g}' for radius in self.radii)}"


Scheme: TypeAlias = FixedScheme | RandomScheme

SCHEMES = {
    "golubkov2018": "L50r3 R75r5 S50 L75r3 S50 L60r4",
    "tsyganov2019": "S250 R314r5 S250 L314r5 S250 L314r5 S250 L314r5 S250",
    "golubkov2020": "S20 R20r5",
}
"""The schemes of the papers: Golubkov 2018, table 1; Tsyganov 2019, example 1; Golubkov 2020."""


def parse_scheme(value: "str | Scheme", name: str = "scheme") -> Scheme:
    """Parse a string; a scheme object is returned as it is. Raises `ArgumentError` for other
    values.
    """
    if isinstance(value, (FixedScheme, RandomScheme)):
        return value
    # A pattern would try every place in a long space.
    text = " ".join(value.split()) if isinstance(value, str) else ""
    text = SCHEMES.get(text, text)
    lengths = r"(?: (\d{1,20})x(\d{1,20})(?:-(\d{1,20}))?)?"
    radius = r" \d+(?:\.\d+)?(?:e[+-]?\d+)?"
    if random := re.fullmatch(rf"random{lengths}(?: radii((?:{radius})+))?", text):
        radii = tuple(map(float, random[4].split())) if random[4] else None
        if random[1] is None:
            return RandomScheme(radii=radii)
        return RandomScheme(int(random[1]), (int(random[2]), int(random[3] or random[2])), radii)
    pieces = []
    named = re.search(r"\d [a-z]", text)
    words = re.split(" ?[,;] ?" if named else "[ ,;]+", text)
    for word in words[: MOST_PIECES + 1]:
        if named and (of_mode := re.fullmatch(r"(\d{1,20}) ([a-z][^,;]*)", word)):
            pieces.append(_named_segment(of_mode[2], int(of_mode[1])))
            continue
        match = re.fullmatch(r"([SLR])(\d{1,20})(?:r([\d.]+(?:e[+-]?\d+)?))?", word)
        parts: tuple[Any, ...] = match.groups() if match else ("", "0", None)
        mode, ticks, radius = parts
        try:
            pieces.append(Segment(mode, int(ticks), float(radius) if radius else None))
        except ValueError:
            allowed = "'S50 L50r3' (mode, ticks, radius), '50 straight, 30 stop', 'random 6x50-100'"
            raise reject(
                name, value, f"{allowed}, or a key of SCHEMES; not {word[:24]!r}"
            ) from None
    return FixedScheme(tuple(pieces))


def _named_segment(name: str, length: int) -> Segment:
    """Return a segment of the mode of a name; turns and straight motion have letters."""
    mode = mode_of_text(name)
    if isinstance(mode, Turn):
        return Segment("L" if mode.radius > 0.0 else "R", length, abs(mode.radius))
    return Segment("S" if isinstance(mode, Straight) else name, length)


def segment_table(scheme: Scheme, modes: Sequence[Mode]) -> FloatArray:
    """Return the segment table, (segments, columns), with columns `core.memory.SEGMENT_COLUMNS`. A
    random scheme has one row per mode, equally likely, with length 0. A turn of a radius that the
    option `radii` leaves out is the mode on the same side with the closest curvature.
    """
    if isinstance(scheme, FixedScheme):
        segments = [(piece.name, piece.signed_radius, piece.length) for piece in scheme.pieces]
    else:
        drawn = modes if scheme.radii is None else modes_of_radii(scheme.radii)
        segments = [(mode.name, mode.signed_radius, 0) for mode in drawn]
    places = {mode.name: k for k, mode in enumerate(modes)}
    by_radii = tuple(modes) == modes_of_radii(radii_of_modes(modes))
    table = []
    for name, radius, length in segments:
        if name not in places and by_radii and radius:
            turns = [mode for mode in modes if mode.signed_radius * radius > 0.0]
            nearest = min(turns, key=lambda turn: abs(1.0 / turn.signed_radius - 1.0 / radius))
            places[name] = places[nearest.name]
        if name not in places:
            raise unknown("scheme", name, [mode.name for mode in modes])
        place = places[name]
        table.append((radius or modes[place].signed_radius, place, length))
    return np.array(table, float)
