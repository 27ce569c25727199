"""Laws of the duration of a segment, for switches at unknown moments.

A law is written as text: "geometric 75" is a geometric distribution on 1, 2, ... with a mean of 75
ticks, "25 + geometric 50" adds 25 ticks, and "uniform 50-100" has equally likely durations from 50
to 100 ticks. "uniform 30-40 or uniform 80-90" is one or the other with equal probability, and
"straight uniform 90-100, turns geometric 30" differs between straight motion and turns; any names
or types of modes may have a law of their own. "drawn" draws a law for every episode.
"""

import re
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
from annotated_types import Interval

from hybrid_env.checks import Checked, FloatArray, reject
from hybrid_env.limits import MAX_LENGTH, Ticks
from hybrid_env.modes import Mode

DRAWN = "drawn"


@dataclass(frozen=True)
class DurationLaw(Checked):
    """A law of the durations of all segments. A law of the user is a subclass with both methods."""

    # Texts of a law, as a message shows them.
    examples: ClassVar[tuple[str, ...]]
    # Pattern of its text, with a group for each field that the text has. A law with one is found by
    # its text.
    form: ClassVar[str]

    @property
    def mean_duration(self) -> float:
        """Expected duration [ticks]."""
        raise NotImplementedError

    def survival(self, ticks: int) -> FloatArray:
        """Return the probabilities that a duration is longer than 0, 1, ..., `ticks`, (ticks +
        1,).
        """
        raise NotImplementedError


@dataclass(frozen=True)
class GeometricDurations(DurationLaw):
    """Durations `offset` + G, where G = 1, 2, ... has a geometric distribution.

    Attributes:
        mean: of G [ticks], at least 1.
        offset: smallest duration minus 1 [ticks].
    """

    examples = ("geometric 75", "25 + geometric 50")
    form = r"(?:(?P<offset>\d{1,20})\s*\+\s*)?geometric\s+(?P<mean>\d{1,20}(?:\.\d{1,20})?)"

    mean: Annotated[float, Interval(ge=1.0, le=MAX_LENGTH)]
    offset: Annotated[int, Interval(ge=0, le=MAX_LENGTH)] = 0

    @property
    def mean_duration(self) -> float:
        """Expected duration [ticks]."""
        return self.offset + self.mean

    def survival(self, ticks: int) -> FloatArray:
        """Return the probabilities that a duration is longer than 0, 1, ..., `ticks`, (ticks +
        1,).
        """
        beyond = np.maximum(np.arange(ticks + 1.0) - self.offset, 0.0)
        return (1.0 - 1.0 / self.mean) ** beyond

    def __str__(self) -> str:
        return (f"{self.offset} + " if self.offset else "") + f"geometric {self.mean:g}"


@dataclass(frozen=True)
class DrawnDurations(GeometricDurations):
    """A law drawn anew for every episode, see `hybrid_env.core.habits`; given as "drawn". Filters
    and rules that assume a law assume the default one, whose attributes these are.
    """

    mean: Annotated[float, Interval(ge=1.0, le=MAX_LENGTH)] = 50.0
    offset: Annotated[int, Interval(ge=0, le=MAX_LENGTH)] = 25

    def __str__(self) -> str:
        return DRAWN


@dataclass(frozen=True)
class UniformDurations(DurationLaw):
    """Equally likely durations from `shortest` to `longest`, both included [ticks]."""

    examples = ("uniform 50-100",)
    # A single number is both.
    form = r"uniform\s+(?=(?P<shortest>\d{1,20}))(?:\d{1,20}\s*-\s*)?(?P<longest>\d{1,20})"

    shortest: Ticks
    longest: Ticks

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shortest > self.longest:
            raise reject(
                "longest", self.longest, f"at least {self.shortest}, the shortest duration"
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
        return left.clip(0.0, 1.0)

    def __str__(self) -> str:
        return f"uniform {self.shortest}-{self.longest}"


@dataclass(frozen=True)
class TwoDurations(DurationLaw):
    """One of two laws, each geometric or uniform, with equal probability, drawn anew for every
    segment.
    """

    one: DurationLaw
    other: DurationLaw

    @property
    def mean_duration(self) -> float:
        """Expected duration [ticks]."""
        return 0.5 * (self.one.mean_duration + self.other.mean_duration)

    def survival(self, ticks: int) -> FloatArray:
        """Return the probabilities that a duration is longer than 0, 1, ..., `ticks`, (ticks +
        1,).
        """
        return 0.5 * (self.one.survival(ticks) + self.other.survival(ticks))

    def __str__(self) -> str:
        return f"{self.one} or {self.other}"


@dataclass(frozen=True)
class ModeDurations:
    """A law for each of several modes.

    Attributes:
        laws: (name, law) of each: the name or the type of a mode, or "turns".
    """

    laws: tuple[tuple[str, DurationLaw], ...]

    @property
    def mean_duration(self) -> float:
        """Mean of the expected durations of the laws [ticks]."""
        return sum(law.mean_duration for _, law in self.laws) / len(self.laws)

    def place(self, mode: Mode) -> int:
        """Return the place of the law of a mode in `laws`."""
        turns = "turns" if mode.type in ("left", "right") else ""
        names = [name for name, _ in self.laws]
        for name in (mode.name, mode.type, turns):
            if name in names:
                return names.index(name)
        raise reject("durations", str(self), f"a law of {mode.name!r} too")

    def __str__(self) -> str:
        return ", ".join(f"{name} {law}" for name, law in self.laws)


Durations: TypeAlias = DurationLaw | ModeDurations


def parse_durations(value: Any, name: str = "durations") -> Durations:
    """Parse a string; a law is returned as it is. Raises `ArgumentError` for other values."""
    if isinstance(value, Durations):
        return value
    text = " ".join(value.split()) if isinstance(value, str) else ""
    if text == DRAWN:
        return DrawnDurations()
    by_mode = [
        re.fullmatch(r"((?!geo|uni)[a-z].*?) ((?:\d+ ?\+|geo|uni).*)", part)
        for part in re.split(", ?", text)
    ]
    parts = [match.groups() for match in by_mode if match]
    if parts and len(parts) == len(by_mode):
        return ModeDurations(tuple((mode, _parse_simple(law, value, name)) for mode, law in parts))
    return _parse_simple(text, value, name)


def _parse_simple(text: str, value: Any, name: str) -> DurationLaw:
    """Parse the law of one mode, which is a part of a value."""
    kinds = [kind for kind in DurationLaw.__subclasses__() if hasattr(kind, "form")]
    laws: list[DurationLaw] = []
    for part in text.split(" or ", 1):
        for kind in kinds:
            if match := re.fullmatch(kind.form, part):
                numbers = {
                    key: float(number) if "." in number else int(number)
                    for key, number in match.groupdict().items()
                    if number is not None
                }
                laws.append(kind(**numbers))
                break
        else:
            examples = ", ".join(repr(text) for kind in kinds for text in kind.examples)
            allowed = "'uniform 30-40 or uniform 80-90', 'straight ..., turns ...', or 'drawn'"
            raise reject(name, value, f"{examples}, {allowed}")
    return TwoDurations(*laws) if len(laws) > 1 else laws[0]


def duration_probabilities(law: DurationLaw, ticks: int) -> FloatArray:
    """Return the probabilities of the durations 1, 2, ..., `ticks`, (ticks,)."""
    return -np.diff(law.survival(ticks))


def remaining_probabilities(law: DurationLaw, ticks: int) -> FloatArray:
    """Return the probabilities that 1, ..., `ticks` ticks of a segment remain at a random moment
    long after the first switch, (ticks,): P(duration >= r) / E[duration], as long segments are
    observed more often.
    """
    return law.survival(ticks)[:-1] / law.mean_duration
