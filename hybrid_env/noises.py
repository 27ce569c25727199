"""Laws of the measurement noise, in units of the standard deviation sqrt(R) of a measured
coordinate.

A law is written as text: "gaussian"; "outliers 0.02 5", where 2 % of the measurements have 5 times
the standard deviation; "levy 1.5 1 44", a symmetric alpha-stable law of index 1.5 and scale 1,
clipped to +-44; "student_t 3" with 3 degrees of freedom. The last numbers may be left out. A bank
assumes normal noise of variance R, or with the option `likelihood` Student's t.
"""

import dataclasses
import math
import re
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from annotated_types import Interval

from hybrid_env.checks import AnyArray, Checked, Share, reject
from hybrid_env.core.noise import GAUSSIAN, LEVY, OUTLIERS, STUDENT_T

# Magnitude of a measurement error over sqrt(R).
LARGEST_ERROR = 1e6

_NUMBER = r"[0-9]{0,20}\.?[0-9]{1,20}(?:[eE][-+]?[0-9]{1,3})?"
_TEXT = re.compile(rf"([a-z_]+)((?:\s+{_NUMBER}){{0,3}})\s*")


@dataclass(frozen=True)
class Noise(Checked):
    """A law of the measurement noise: each subclass here is a law, whose fields are the numbers of
    its text. Others, which the kernel cannot draw, are refused.
    """

    # Its text, which begins with its name.
    example: ClassVar[str]
    # Of `core.noise`.
    law: ClassVar[int]
    # Shape, scale and clip for the kernel: a number or the name of a field.
    numbers: ClassVar[tuple[str | float, ...]]

    def write_parameters(self, record: AnyArray) -> None:
        """Write the law into a (1,) record `core.memory.PARAMETERS`."""
        record["noise_law"] = self.law
        for name, number in zip(
            ("noise_shape", "noise_scale", "noise_clip"),
            self.numbers,
            strict=True,
        ):
            record[name] = getattr(self, number) if isinstance(number, str) else number

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
    clip: Annotated[float, Interval(ge=1e-3, le=LARGEST_ERROR)] = LARGEST_ERROR


@dataclass(frozen=True)
class StudentNoise(Noise):
    """Errors with the bivariate Student t distribution of scale matrix R, clipped at
    `LARGEST_ERROR`.

    Large errors of both coordinates occur together. A coordinate has the variance R freedom /
    (freedom - 2), with degrees of freedom from 1 (Cauchy) to 10^6, where it equals the normal
    distribution in all digits that matter.
    """

    example = "student_t 3"
    law = STUDENT_T
    numbers = ("freedom", 1.0, LARGEST_ERROR)

    freedom: Annotated[float, Interval(ge=1.0, le=1e6)]


_LAWS: dict[str, type[Noise]] = {
    law.example.partition(" ")[0]: law for law in Noise.__subclasses__()
}
GRAMMAR = ", ".join(repr(law.example) for law in _LAWS.values()) + ", or a law of hybrid_env.noises"


def parse_noise(value: Any, name: str = "noise", grammar: str = GRAMMAR) -> Noise:
    """Parse a text or check a law. name, grammar: the argument and what is allowed, for the
    message.

    The kernel draws the laws of this module only: other subclasses of `Noise` raise
    `ArgumentError`.
    """
    if type(value) in _LAWS.values():
        # Checks the numbers again, as a copy may have others.
        return dataclasses.replace(value)
    match = _TEXT.fullmatch(value.strip()) if isinstance(value, str) else None
    if match and match[1] in _LAWS:
        try:
            return _LAWS[match[1]](*map(float, match[2].split()))
        except TypeError:
            # Too few or too many numbers.
            pass
        except ValueError as error:
            raise reject(name, value, f"{grammar} ({error})") from None
    raise reject(name, value, grammar)


def parse_likelihood(value: Any, name: str = "likelihood") -> GaussianNoise | StudentNoise:
    """Parse the law that a bank assumes of the innovations; see `parse_noise`."""
    allowed = "'gaussian', 'student_t 4', or one of these laws of hybrid_env.noises"
    law = parse_noise(value, name, allowed)
    if not isinstance(law, (GaussianNoise, StudentNoise)):
        raise reject(name, value, allowed)
    return law
