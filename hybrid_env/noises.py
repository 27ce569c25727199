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
from typing import Any, ClassVar

from numpy.typing import NDArray

from hybrid_env.checks import Checked, check_share, ranged, reject
from hybrid_env.core.noise import GAUSSIAN, LEVY, OUTLIERS, STUDENT_T

# Magnitude of a measurement error over sqrt(R).
LARGEST_ERROR = 1e6
# Of the standard deviations of outliers and other measurements.
LARGEST_RATIO = 1e3
# From here on Student's t equals the normal distribution in all digits that matter.
LARGEST_FREEDOM = 1e6
LIKELIHOODS = "'gaussian', 'student_t 4', or one of these laws of hybrid_env.noises"

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

    def write_parameters(self, record: NDArray[Any]) -> None:
        """Write the law into a (1,) record `core.state.PARAMETERS`."""
        record["noise_law"] = self.law
        for name, one in zip(
            ("noise_shape", "noise_scale", "noise_clip"),
            self.numbers,
            strict=True,
        ):
            record[name] = getattr(self, one) if isinstance(one, str) else one

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

    checks: ClassVar = {"share": check_share, "ratio": ranged(1.0, LARGEST_RATIO)}

    share: float
    ratio: float = 5.0


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

    checks: ClassVar = {
        "index": ranged(0.5, 2.0),
        "scale": ranged(1e-3, 1e3),
        "clip": ranged(1e-3, LARGEST_ERROR),
    }

    index: float
    scale: float = 1.0
    clip: float = LARGEST_ERROR


@dataclass(frozen=True)
class StudentNoise(Noise):
    """Errors with the bivariate Student t distribution of scale matrix R, clipped at
    `LARGEST_ERROR`.

    Large errors of both coordinates occur together. A coordinate has the variance R freedom /
    (freedom - 2), with degrees of freedom from 1 (Cauchy) to `LARGEST_FREEDOM`.
    """

    example = "student_t 3"
    law = STUDENT_T
    numbers = ("freedom", 1.0, LARGEST_ERROR)

    checks: ClassVar = {"freedom": ranged(1.0, LARGEST_FREEDOM)}

    freedom: float


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
    found = _TEXT.fullmatch(value.strip()) if isinstance(value, str) else None
    if found and found[1] in _LAWS:
        law = _LAWS[found[1]]
        numbers = [float(number) for number in found[2].split()]
        fields = dataclasses.fields(law)
        if (
            sum(field.default is dataclasses.MISSING for field in fields)
            <= len(numbers)
            <= len(fields)
        ):
            try:
                return law(*numbers)
            except ValueError as error:
                raise reject(name, value, f"{grammar} ({error})") from None
    raise reject(name, value, grammar)


def parse_likelihood(value: Any) -> GaussianNoise | StudentNoise:
    """Parse the law that a bank assumes of the innovations; see `parse_noise`."""
    law = parse_noise(value, "likelihood", LIKELIHOODS)
    if not isinstance(law, (GaussianNoise, StudentNoise)):
        raise reject("likelihood", value, LIKELIHOODS)
    return law
