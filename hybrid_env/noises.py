"""Laws of the measurement noise, in units of the standard deviation sqrt(R) of a measured coordinate.

A law is written as text: "gaussian"; "outliers 0.02 5", where 2 % of the measurements have 5 times the
standard deviation; "levy 1.5 1 44", a symmetric alpha-stable law of index 1.5 and scale 1, clipped to +-44;
"student_t 3" with 3 degrees of freedom. The last numbers may be left out. A bank assumes normal noise of
variance R, or with the option `likelihood` Student's t.
"""

import math
import re
from dataclasses import dataclass
from typing import Any, TypeAlias

from hybrid_env.checks import check_number, reject
from hybrid_env.core.noise import GAUSSIAN, LEVY, OUTLIERS, STUDENT_T

LARGEST_ERROR = 1e6  # magnitude of a measurement error over sqrt(R)
LARGEST_RATIO = 1e3  # of the standard deviations of outliers and other measurements
LARGEST_FREEDOM = 1e6  # from here on Student's t equals the normal distribution in all digits that matter
GRAMMAR = "'gaussian', 'outliers 0.02', 'levy 1.5 1 44', 'student_t 3', or a law of hybrid_env.noises"
LIKELIHOODS = "'gaussian', 'student_t 4', or one of these laws of hybrid_env.noises"

_NUMBER = r"[0-9]{0,20}\.?[0-9]{1,20}(?:[eE][-+]?[0-9]{1,3})?"
_TEXT = re.compile(rf"(gaussian|outliers|levy|student_t)((?:\s+{_NUMBER}){{0,3}})\s*")


def _fix(law: Any, name: str, low: float, high: float, allowed: str = "") -> None:
    """Check that a number of a law is in a range, and store it as a float."""
    allowed = allowed or f"a number from {low:g} to {high:g}"
    number = check_number(name, getattr(law, name), allowed)
    if not low <= number <= high:
        raise reject(name, number, allowed)
    object.__setattr__(law, name, number)


@dataclass(frozen=True)
class GaussianNoise:
    """Independent normal errors of variance R."""

    @property
    def parameters(self) -> tuple[int, float, float, float]:
        """Law, shape, scale and clip for the kernel."""
        return GAUSSIAN, 0.0, 1.0, math.inf

    def __str__(self) -> str:
        return "gaussian"


@dataclass(frozen=True)
class OutlierNoise:
    """Normal errors; in a share of the measurements both coordinates have a larger standard deviation.

    Attributes:
        share: of outliers, at least 0 and below 1.
        ratio: of the standard deviations of outliers and other measurements.

    Raises:
        ArgumentError: an attribute has a value that is not allowed.
    """

    share: float
    ratio: float = 5.0

    def __post_init__(self) -> None:
        _fix(self, "share", 0.0, math.nextafter(1.0, 0.0), "a number >= 0 and < 1")
        _fix(self, "ratio", 1.0, LARGEST_RATIO)

    @property
    def parameters(self) -> tuple[int, float, float, float]:
        """Law, shape, scale and clip for the kernel."""
        return OUTLIERS, self.share, self.ratio, math.inf

    def __str__(self) -> str:
        return f"outliers {self.share:.15g} {self.ratio:.15g}"


@dataclass(frozen=True)
class LevyNoise:
    """Symmetric alpha-stable errors of each coordinate, independent and clipped.

    The characteristic function is `exp(-|scale t|^index)`: normal with variance 2 scale^2 at index 2, Cauchy
    at index 1. Below index 2 the variance is infinite before the clipping. It is drawn as in Chambers,
    Mallows & Stuck 1976, "A method for simulating stable random variables".

    Attributes:
        index: alpha, from 0.5 to 2.
        scale: in units of sqrt(R).
        clip: largest magnitude of an error, in units of sqrt(R).

    Raises:
        ArgumentError: an attribute has a value that is not allowed.
    """

    index: float
    scale: float = 1.0
    clip: float = LARGEST_ERROR

    def __post_init__(self) -> None:
        _fix(self, "index", 0.5, 2.0)
        _fix(self, "scale", 1e-3, 1e3)
        _fix(self, "clip", 1e-3, LARGEST_ERROR)

    @property
    def parameters(self) -> tuple[int, float, float, float]:
        """Law, shape, scale and clip for the kernel."""
        return LEVY, self.index, self.scale, self.clip

    def __str__(self) -> str:
        return f"levy {self.index:.15g} {self.scale:.15g} {self.clip:.15g}"


@dataclass(frozen=True)
class StudentNoise:
    """Errors with the bivariate Student t distribution of scale matrix R, clipped at `LARGEST_ERROR`.

    Large errors of both coordinates occur together. A coordinate has the variance R freedom / (freedom - 2).

    Attributes:
        freedom: degrees of freedom, from 1 (Cauchy) to `LARGEST_FREEDOM`.

    Raises:
        ArgumentError: the attribute has a value that is not allowed.
    """

    freedom: float

    def __post_init__(self) -> None:
        _fix(self, "freedom", 1.0, LARGEST_FREEDOM)

    @property
    def parameters(self) -> tuple[int, float, float, float]:
        """Law, shape, scale and clip for the kernel."""
        return STUDENT_T, self.freedom, 1.0, LARGEST_ERROR

    def __str__(self) -> str:
        return f"student_t {self.freedom:.15g}"


Noise: TypeAlias = GaussianNoise | OutlierNoise | LevyNoise | StudentNoise

_LAWS: dict[str, tuple[type[Any], int, int]] = {  # class, fewest and most numbers
    "gaussian": (GaussianNoise, 0, 0),
    "outliers": (OutlierNoise, 1, 2),
    "levy": (LevyNoise, 1, 3),
    "student_t": (StudentNoise, 1, 1),
}


def parse_noise(value: Any, name: str = "noise", grammar: str = GRAMMAR) -> Noise:
    """Parse a text; a law is returned as it is.

    Args:
        value: text or law.
        name, grammar: the argument and what is allowed, for the message.

    Raises:
        ArgumentError: any other value.
    """
    if isinstance(value, (GaussianNoise, OutlierNoise, LevyNoise, StudentNoise)):
        return value
    found = _TEXT.fullmatch(value.strip()) if isinstance(value, str) else None
    if found:
        law, fewest, most = _LAWS[found[1]]
        numbers = [float(number) for number in found[2].split()]
        if fewest <= len(numbers) <= most:
            try:
                parsed: Noise = law(*numbers)
            except ValueError as error:
                raise reject(name, value, f"{grammar} ({error})") from None
            return parsed
    raise reject(name, value, grammar)


def parse_likelihood(value: Any) -> GaussianNoise | StudentNoise:
    """Parse the law that a bank assumes of the innovations; see `parse_noise`."""
    law = parse_noise(value, "likelihood", LIKELIHOODS)
    if not isinstance(law, (GaussianNoise, StudentNoise)):
        raise reject("likelihood", value, LIKELIHOODS)
    return law
