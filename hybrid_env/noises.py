"""Laws of the measurement noise, in units of the standard deviation sqrt(R) of a measured
coordinate.

A law is written as text: "gaussian"; "outliers 0.02 5", where 2 % of the measurements have 5 times
the standard deviation; "levy 1.5 1 44", a symmetric alpha-stable law of index 1.5 and scale 1,
clipped to +-44; "student_t 3" with 3 degrees of freedom. The last numbers may be left out. A law of
the user is a subclass of `OwnNoise`. A bank assumes normal noise of variance R, or with the option
`likelihood` Student's t.
"""

import dataclasses
import functools
import math
from abc import ABC, abstractmethod
from collections import namedtuple
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Interval

from hybrid_env.checks import Checked, Share, declared_fields, reject
from hybrid_env.core.noise import GAUSSIAN, LEVY, OUTLIERS, OWN, STUDENT_T, compile_law


@dataclass(frozen=True)
class Noise(Checked):
    """A law of the measurement noise. A law with an `example` is found by its text, whose
    numbers are its fields.
    """

    # Its text, which begins with its name.
    example: ClassVar[str]
    # The number of the law in `core.noise`.
    law: ClassVar[int]
    # Shape, scale and clip for the kernel: a number or the name of a field.
    numbers: ClassVar[tuple[str | float, ...]]

    def parameters(self) -> dict[str, float]:
        """Return the law as fields of the record `core.memory.PARAMETERS`."""
        numbers = [
            getattr(self, number) if isinstance(number, str) else number for number in self.numbers
        ]
        names = ("noise_shape", "noise_scale", "noise_clip")
        return dict(zip(names, numbers, strict=True), noise_law=self.law)

    def as_json(self) -> str:
        """Return the text, for files that name the options."""
        return str(self)

    def __str__(self) -> str:
        numbers = [f"{getattr(self, field.name):.15g}" for field in dataclasses.fields(self)]
        return " ".join([self.example.partition(" ")[0], *numbers])


@dataclass(frozen=True)
class GaussianNoise(Noise):
    """Independent normal errors of variance R."""

    example = "gaussian"
    law = GAUSSIAN
    numbers = (0.0, 1.0, math.inf)


@dataclass(frozen=True)
class OutlierNoise(Noise):
    """Normal errors; in a share of the measurements both coordinates have a larger standard
    deviation.

    Attributes:
        share: of outliers, at least 0 and below 1.
        ratio: of the standard deviations of outliers and other measurements.
    """

    example = "outliers 0.02"
    law = OUTLIERS
    numbers = ("share", "ratio", math.inf)

    share: Share
    ratio: Annotated[float, Interval(ge=1.0, le=1e3)] = 5.0


@dataclass(frozen=True)
class LevyNoise(Noise):
    """Symmetric alpha-stable errors of each coordinate, independent and clipped.

    The characteristic function is `exp(-|scale t|^index)`: normal with variance 2 scale^2 at index
    2, Cauchy at index
    1. Below index 2 the variance is infinite before the clipping. It is drawn as in Chambers,
    Mallows & Stuck 1976, "A method for simulating stable random variables".

    Attributes:
        index: alpha, from 0.5 to 2.
        scale: in units of sqrt(R).
        clip: largest magnitude of an error, in units of sqrt(R).
    """

    example = "levy 1.5 1 44"
    law = LEVY
    numbers = ("index", "scale", "clip")

    index: Annotated[float, Interval(ge=0.5, le=2.0)]
    scale: Annotated[float, Interval(ge=1e-3, le=1e3)] = 1.0
    clip: Annotated[float, Interval(ge=1e-3, le=1e6)] = 1e6


@dataclass(frozen=True)
class StudentNoise(Noise):
    """Errors with the bivariate Student t distribution of scale matrix R, clipped at
    10^6.

    Large errors of both coordinates occur together. A coordinate has the variance R freedom /
    (freedom - 2), with degrees of freedom from 1 (Cauchy) to 10^6, where it equals the normal
    distribution in all digits that matter.
    """

    example = "student_t 3"
    law = STUDENT_T
    numbers = ("freedom", 1.0, 1e6)

    freedom: Annotated[float, Interval(ge=1.0, le=1e6)]


@dataclass(frozen=True)
class OwnNoise(Noise, ABC):
    """The base of a law of the user: a subclass defines `draw`, which numba compiles.

    `draw` calls functions of `math` and functions that `numba.njit` compiles. If the subclass is a
    dataclass, with `frozen=True`, `draw` reads the fields as `self.scale`; `self` has nothing else
    there. Each combination of values is compiled once in a process, in less than a second.
    """

    @abstractmethod
    def draw(self, u: tuple[float, float, float, float]) -> tuple[float, float]:
        """Return the errors of x and y in units of sqrt(R), which are clipped at 10^6.

        u: four independent random numbers, uniform from 0 to below 1, of the track's own stream.
        Any other random number would not follow the seed.
        """

    def parameters(self) -> dict[str, float]:
        """See `Noise.parameters`."""
        return {"noise_law": OWN, "noise_function": _compiled(self).address}

    def __str__(self) -> str:
        return " ".join([type(self).__name__, *map(str, dataclasses.astuple(self))])


# What is compiled is kept: an environment has its address only.
@functools.cache
def _compiled(law: OwnNoise) -> Any:
    """Return the compiled function of a law. Python tries the law before, because its messages
    say more.
    """
    try:
        tried = [law.draw(tuple(u)) for u in np.random.default_rng(0).random((1000, 4)).tolist()]
        errors = np.array(tried, float)
        if errors.shape != (1000, 2) or not np.isfinite(errors).all():
            raise ValueError(f"it returns {tried[0]}")
        fields = {name: getattr(law, name) for name in declared_fields(type(law))}
        return compile_law(type(law).draw, namedtuple(type(law).__name__, fields)(**fields))
    except Exception as error:
        lines = [line for line in str(error).splitlines() if not line.startswith("Failed in")]
        reason = f"{type(error).__name__}: {lines[0] if lines else error}"
        raise reject("noise", law, f"a law that draws two finite numbers ({reason})") from None


def parse_noise(value: Any, name: str = "noise", allowed: str = "") -> Noise:
    """Parse a text or check a law. name, allowed: the argument and what it may be, for the
    message.
    """
    words = value.split() if isinstance(value, str) else []
    laws = [law for law in Noise.__subclasses__() if hasattr(law, "example")]
    named = {law.example.partition(" ")[0]: law for law in laws}
    examples = ", ".join(repr(law.example) for law in laws)
    allowed = allowed or f"{examples}, or a law of hybrid_env.noises"
    try:
        if isinstance(value, Noise):
            # What is compiled for a law is found by its values.
            hash(value)
            return value
        if words and words[0] in named:
            return named[words[0]](*map(float, words[1:]))
    except (TypeError, ValueError) as error:
        raise reject(name, value, f"{allowed} ({error})") from None
    raise reject(name, value, allowed)


def parse_likelihood(value: Any, name: str = "likelihood") -> GaussianNoise | StudentNoise:
    """Parse the law that a bank assumes of the innovations; see `parse_noise`."""
    allowed = "'gaussian', 'student_t 4', or one of these laws of hybrid_env.noises"
    law = parse_noise(value, name, allowed)
    if not isinstance(law, (GaussianNoise, StudentNoise)):
        raise reject(name, value, allowed)
    return law
