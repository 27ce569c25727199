"""Laws of the duration of a segment, for switches at unknown moments.

A law is written as text: "geometric 75" is a geometric distribution on 1, 2, ... with a mean of 75
ticks, "25 + geometric 50" adds 25 ticks, and "uniform 50-100" has equally likely durations from 50
to 100 ticks. "uniform 30-40 or uniform 80-90" is one or the other with equal probability, and
"straight uniform 90-100, turns geometric 30" differs between straight motion and turns. "drawn"
draws a law for every episode.
"""

import re
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, TypeAlias, get_args

import numpy as np

from hybrid_env.checks import Checked, FloatArray, check_integer, ranged, reject
from hybrid_env.limits import MAX_LENGTH, check_ticks

DRAWN = "drawn"
GRAMMAR = (
    "'geometric 75', '25 + geometric 50', 'uniform 50-100', 'uniform 30-40 or uniform 80-90', "
    "'straight uniform 90-100, turns geometric 30', 'drawn', or a law of hybrid_env.durations"
)

_INTEGER = "[0-9]{1,20}"
_BY_MODE = re.compile("straight ([^,]+), ?turns ([^,]+)")
_GEOMETRIC = re.compile(rf"(?:({_INTEGER})\s*\+\s*)?geometric\s+({_INTEGER}(?:\.{_INTEGER})?)")
_UNIFORM = re.compile(rf"uniform\s+({_INTEGER})(?:\s*-\s*({_INTEGER}))?")


@dataclass(frozen=True)
class GeometricDurations(Checked):
    """Durations `offset` + G, where G = 1, 2, ... has a geometric distribution.

    Attributes:
        mean: of G [ticks], at least 1.
        offset: smallest duration minus 1 [ticks].
    """

    checks: ClassVar = {
        "mean": ranged(1.0, MAX_LENGTH, f"a number of ticks from 1 to {MAX_LENGTH}"),
        "offset": partial(check_integer, minimum=0, maximum=MAX_LENGTH),
    }

    mean: float
    offset: int = 0

    @property
    def mean_duration(self) -> float:
        """Expected duration [ticks]."""
        return self.offset + self.mean

    def survival(self, ticks: int) -> FloatArray:
        """Return the probabilities that a duration is longer than 0, 1, ..., `ticks`, (ticks +
        1,).
        """
        beyond = np.maximum(np.arange(ticks + 1.0) - self.offset, 0.0)
        return np.asarray((1.0 - 1.0 / self.mean) ** beyond)

    def __str__(self) -> str:
        return (f"{self.offset} + " if self.offset else "") + f"geometric {self.mean:g}"


@dataclass(frozen=True)
class DrawnDurations(GeometricDurations):
    """A law drawn anew for every episode, see `hybrid_env.core.habits`; given as "drawn". Filters
    and rules that assume a law assume the default one, whose attributes these are.
    """

    mean: float = 50.0
    offset: int = 25

    def __str__(self) -> str:
        return DRAWN


@dataclass(frozen=True)
class UniformDurations(Checked):
    """Equally likely durations from `shortest` to `longest`, both included [ticks]."""

    checks: ClassVar = {"shortest": check_ticks, "longest": check_ticks}

    shortest: int
    longest: int

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shortest > self.longest:
            raise reject(
                "longest",
                self.longest,
                f"at least {self.shortest}, the shortest duration",
            )

    @property
    def mean_duration(self) -> float:
        """Expected duration [ticks]."""
        return 0.5 * (self.shortest + self.longest)

    def survival(self, ticks: int) -> FloatArray:
        """Return the probabilities that a duration is longer than 0, 1, ..., `ticks`, (ticks +
        1,).
        """
        left = (self.longest - np.arange(ticks + 1.0)) / (self.longest - self.shortest + 1.0)
        return np.asarray(left.clip(0.0, 1.0))

    def __str__(self) -> str:
        return f"uniform {self.shortest}-{self.longest}"


@dataclass(frozen=True)
class _Pair:
    """Two laws of some kinds, of which each holds for half of the segments."""

    kinds: ClassVar[tuple[type, ...]] = (GeometricDurations, UniformDurations)

    def __post_init__(self) -> None:
        for name, law in vars(self).items():
            if type(law) not in self.kinds:
                raise reject(name, law, " or ".join(kind.__name__ for kind in self.kinds))

    @property
    def mean_duration(self) -> float:
        """Expected duration [ticks]."""
        one, other = vars(self).values()
        return 0.5 * float(one.mean_duration + other.mean_duration)


@dataclass(frozen=True)
class TwoDurations(_Pair):
    """One of two laws, each geometric or uniform, with equal probability, drawn anew for every
    segment.
    """

    one: GeometricDurations | UniformDurations
    other: GeometricDurations | UniformDurations

    def survival(self, ticks: int) -> FloatArray:
        """Return the probabilities that a duration is longer than 0, 1, ..., `ticks`, (ticks +
        1,).
        """
        return 0.5 * (self.one.survival(ticks) + self.other.survival(ticks))

    def __str__(self) -> str:
        return f"{self.one} or {self.other}"


SimpleDurations: TypeAlias = GeometricDurations | UniformDurations | TwoDurations


@dataclass(frozen=True)
class ModeDurations(_Pair):
    """A law of straight segments and another one of turns."""

    kinds = get_args(SimpleDurations)

    straight: SimpleDurations
    turns: SimpleDurations

    def __str__(self) -> str:
        return f"straight {self.straight}, turns {self.turns}"


Durations: TypeAlias = SimpleDurations | ModeDurations


def laws_by_mode(law: Durations) -> tuple[SimpleDurations, SimpleDurations]:
    """Return the laws of straight motion and of turns."""
    return (law.straight, law.turns) if isinstance(law, ModeDurations) else (law, law)


def parse_durations(value: Any) -> Durations:
    """Parse a string; a law is returned as it is. Raises `ArgumentError` for other values."""
    if isinstance(value, Durations):
        return value
    text = " ".join(value.split()) if isinstance(value, str) else ""
    if text == DRAWN:
        return DrawnDurations()
    if by_mode := _BY_MODE.fullmatch(text):
        return ModeDurations(*(_parse_simple(part, value) for part in by_mode.groups()))
    return _parse_simple(text, value)


def _parse_simple(text: str, value: Any) -> SimpleDurations:
    """Parse the law of one mode, which is a part of a value."""
    laws: list[GeometricDurations | UniformDurations] = []
    for part in text.split(" or ", 1):
        if geometric := _GEOMETRIC.fullmatch(part):
            laws.append(GeometricDurations(float(geometric[2]), int(geometric[1] or 0)))
        elif uniform := _UNIFORM.fullmatch(part):
            laws.append(UniformDurations(int(uniform[1]), int(uniform[2] or uniform[1])))
        else:
            raise reject("durations", value, GRAMMAR)
    return TwoDurations(*laws) if len(laws) > 1 else laws[0]


def duration_probabilities(law: SimpleDurations, ticks: int) -> FloatArray:
    """Return the probabilities of the durations 1, 2, ..., `ticks`, (ticks,)."""
    return -np.diff(law.survival(ticks))


def remaining_probabilities(law: SimpleDurations, ticks: int) -> FloatArray:
    """Return the probabilities that 1, ..., `ticks` ticks of a segment remain at a random moment
    long after the first switch, (ticks,): P(duration >= r) / E[duration], as long segments are
    observed more often.
    """
    return law.survival(ticks)[:-1] / law.mean_duration
