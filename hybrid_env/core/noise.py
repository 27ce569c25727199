"""Random numbers of the kernel: one xoshiro256++ generator per track, and the noise of the object
from it. A track of a vector environment has the same stream as a single environment with the same
seed. Blackman & Vigna 2021 (xoshiro256++); Box & Muller 1958 (normals); Chambers, Mallows & Stuck
1976 (stable distributions); Bailey 1994 (Student's t). None has a rejection step, so that several
tracks, or ticks of one track, are drawn with SIMD code.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import carray, cfunc, njit, types
from numpy.typing import NDArray

from hybrid_env.core.arrays import FloatArray
from hybrid_env.core.compilation import apart, inlined, internal, stay_apart
from hybrid_env.core.elementary import ONE, exp, float_of, log, sine_cosine
from hybrid_env.core.errors import ArgumentError
from hybrid_env.core.memory import LANES, address_as

# Laws of the measurement noise; the last one calls a function of the user.
GAUSSIAN, OUTLIERS, LEVY, STUDENT_T, OWN = range(5)
# The row with the uniform number that decides whether a tick has a measurement.
LOST = 6
# Of the elementary exponential.
LARGEST_EXPONENT = 700.0


@inlined
def _advance(
    s0: np.uint64, s1: np.uint64, s2: np.uint64, s3: np.uint64
) -> tuple[np.uint64, tuple[np.uint64, np.uint64, np.uint64, np.uint64]]:
    """Return the next 64 random bits and the next state. xoshiro256++."""
    total = s0 + s3
    bits = ((total << np.uint64(23)) | (total >> np.uint64(41))) + s0
    shifted = s1 << np.uint64(17)
    s2 ^= s0
    s3 ^= s1
    s1 ^= s2
    s0 ^= s3
    s2 ^= shifted
    s3 = (s3 << np.uint64(45)) | (s3 >> np.uint64(19))
    return bits, (s0, s1, s2, s3)


@inlined
def _to_uniform(bits: np.uint64) -> float:
    """Return a uniform number in [0, 1) with 52 random bits, the mantissa of a number in [1, 2)."""
    return float_of(np.int64((bits >> np.uint64(12)) | np.uint64(ONE))) - 1.0


@inlined
def next_uint64(state: NDArray[np.uint64], lane: int) -> np.uint64:
    """Return the next 64 random bits. state: (4, LANES), not all zero in the lane, advanced in
    place.
    """
    bits, words = _advance(state[0, lane], state[1, lane], state[2, lane], state[3, lane])
    state[0, lane], state[1, lane], state[2, lane], state[3, lane] = words
    return bits


@internal
def uniform(state: NDArray[np.uint64], lane: int) -> float:
    """Return a uniform number in [0, 1)."""
    return _to_uniform(next_uint64(state, lane))


@internal
def _draw_uniforms(state: NDArray[np.uint64], lane: int, noise: FloatArray, column: int) -> None:
    """Draw four uniforms into rows 0 .. 3 of a column, with the state in registers."""
    s0 = state[0, lane]
    s1 = state[1, lane]
    s2 = state[2, lane]
    s3 = state[3, lane]
    for k in range(4):
        bits, (s0, s1, s2, s3) = _advance(s0, s1, s2, s3)
        noise[k, column] = _to_uniform(bits)
    state[0, lane], state[1, lane], state[2, lane], state[3, lane] = s0, s1, s2, s3


@internal
def integer_below(state: NDArray[np.uint64], lane: int, bound: int) -> np.int64:
    """Return a uniform integer in 0 .. bound - 1. The bias of the product method is below bound
    / 2^52.
    """
    return np.int64(uniform(state, lane) * bound)


@internal
def draw_noise(
    state: NDArray[np.uint64], noise: FloatArray, first: int, last: int, setting: Any
) -> None:
    """Draw the noise of one tick for lanes first .. last - 1, (7, LANES). Rows 0 and 1 are draws of
    N(0, 1), of magnitude below 8.5, for the velocities; 2 and 3 errors of the measured coordinates
    over sqrt(R); row `LOST` is uniform in [0, 1) if measurements may be missing.
    """
    if setting.noise_law == GAUSSIAN and setting.missed == 0.0:
        draw_normals(state, noise, first, last, None)
    else:
        _draw_by_law(state, noise, first, last, setting)


@apart
def draw_normals(
    state: NDArray[np.uint64], noise: FloatArray, first: int, last: int, ahead: int | None
) -> None:
    """Draw rows 0 to 3 of the noise, all of them of N(0, 1), see `draw_noise`; or of consecutive
    ticks of the lane `ahead` into columns first .. last - 1.
    """
    stay_apart()
    for column in range(first, last):
        _draw_uniforms(state, column if ahead is None else ahead, noise, column)
    _to_normals(noise, 0, first, last)
    _to_normals(noise, 2, first, last)


@apart
def _draw_by_law(
    state: NDArray[np.uint64], noise: FloatArray, first: int, last: int, setting: Any
) -> None:
    """Draw the noise of measurements that may be missing, or of another law; see `draw_noise`."""
    stay_apart()
    for lane in range(first, last):
        _draw_uniforms(state, lane, noise, lane)
        _draw_further(state, lane, noise, setting)
    _to_noise(noise, first, last, setting)


@internal
def _draw_further(state: NDArray[np.uint64], lane: int, noise: FloatArray, setting: Any) -> None:
    """Draw the uniform numbers that only some settings need: rows 4 and 5 for the law, and
    `LOST`.
    """
    if setting.noise_law == OUTLIERS or setting.noise_law == LEVY or setting.noise_law == OWN:
        noise[4, lane] = uniform(state, lane)
    if setting.noise_law == LEVY or setting.noise_law == OWN:
        noise[5, lane] = uniform(state, lane)
    if setting.missed > 0.0:
        noise[LOST, lane] = uniform(state, lane)


@inlined
def _to_noise(noise: FloatArray, first: int, last: int, setting: Any) -> None:
    """Transform the uniforms in columns first .. last - 1 to normals and to draws of the law."""
    _to_normals(noise, 0, first, last)
    if setting.noise_law == LEVY:
        _to_stable(noise, first, last, setting)
    elif setting.noise_law == STUDENT_T:
        _to_student(noise, first, last, setting)
    elif setting.noise_law == OWN:
        # An exception here would tie the bitcode of a kernel to numba.
        if not _function_at(setting.noise_function)(noise.ctypes, first, last):
            setting.noise_failed = True
    else:
        _to_normals(noise, 2, first, last)
    if setting.noise_law == OUTLIERS:
        for column in range(first, last):
            factor = setting.noise_scale if noise[4, column] < setting.noise_shape else 1.0
            noise[2, column] *= factor
            noise[3, column] *= factor


@internal
def _to_normals(noise: FloatArray, k: int, first: int, last: int) -> None:
    """Transform the uniforms in rows k and k + 1 to independent normals. Box & Muller 1958."""
    for column in range(first, last):
        radius = math.sqrt(-2.0 * log(1.0 - noise[k, column]))
        sine, cosine = sine_cosine(2.0 * math.pi * noise[k + 1, column])
        noise[k, column] = radius * cosine
        noise[k + 1, column] = radius * sine


@inlined
def _stable(number: float, other: float, index: float) -> float:
    """Return a draw with the characteristic function exp(-|t|^index): Chambers, Mallows & Stuck
    1976, eq. (4.1).
    """
    angle = math.pi * (number - 0.5)
    sine, _ = sine_cosine(index * angle)
    _, cosine = sine_cosine(angle)
    _, other_cosine = sine_cosine((1.0 - index) * angle)
    waiting = -log(1.0 - other)
    # That of the largest angle below 90 degrees.
    smallest = 1e-17
    # In logarithms, so that no factor overflows.
    exponent = (
        log(abs(sine))
        - log(max(cosine, smallest)) / index
        + (1.0 - index) / index * (log(max(other_cosine, smallest)) - log(waiting))
    )
    size = exp(max(min(exponent, LARGEST_EXPONENT), -LARGEST_EXPONENT))
    return size if sine > 0.0 else -size


@internal
def _to_stable(noise: FloatArray, first: int, last: int, setting: Any) -> None:
    """Transform the uniforms in rows 2 .. 5 to two independent stable draws in rows 2 and 3."""
    index = setting.noise_shape
    scale = setting.noise_scale
    clip = setting.noise_clip
    for k in range(2, 4):
        for column in range(first, last):
            draw = scale * _stable(noise[k, column], noise[k + 2, column], index)
            noise[k, column] = max(min(draw, clip), -clip)


@internal
def _to_student(noise: FloatArray, first: int, last: int, setting: Any) -> None:
    """Transform the uniforms in rows 2 and 3 to a draw of the bivariate Student t distribution.
    Bailey 1994: its squared radius r satisfies P(r > q) = (1 + q / freedom)^(-freedom / 2).
    """
    freedom = setting.noise_shape
    scale = setting.noise_scale
    clip = setting.noise_clip
    for column in range(first, last):
        power = exp(min(-2.0 / freedom * log(1.0 - noise[2, column]), LARGEST_EXPONENT))
        radius = scale * math.sqrt(max(freedom * (power - 1.0), 0.0))
        sine, cosine = sine_cosine(2.0 * math.pi * noise[3, column])
        noise[2, column] = max(min(radius * cosine, clip), -clip)
        noise[3, column] = max(min(radius * sine, clip), -clip)


def draw_failed() -> ArgumentError:
    """Return the error of a law of the user whose function has raised an exception."""
    return ArgumentError("noise: `draw` raised the exception that is printed above")


_COLUMNS = types.boolean(types.CPointer(types.float64), types.intp, types.intp)
"""Signature of the function of a law of the user: the array of the noise, first and last. numba
prints an exception and returns False.
"""

_function_at = address_as(types.ExternalFunctionPointer(_COLUMNS, int))


@internal
def _limited(error: float) -> float:
    """Return an error of a law of the user, over sqrt(R), of a magnitude of at most a million, also
    of infinity and NaN.
    """
    return error if abs(error) <= 1e6 else math.copysign(1e6, error)


def compile_law(draw: Callable[..., Any], law: tuple[Any, ...]) -> Any:
    """Compile the function `draw(law, u)` of a law of the user, see `noises.OwnNoise`. The result
    has the field `address`, and is valid as long as the result exists.
    """
    drawn = njit(error_model="numpy")(draw)

    def draw_columns(pointer: Any, first: int, last: int) -> bool:
        noise = carray(pointer, (7, LANES))
        for column in range(first, last):
            u = (noise[2, column], noise[3, column], noise[4, column], noise[5, column])
            x, y = drawn(law, u)
            noise[2, column] = _limited(x)
            noise[3, column] = _limited(y)
        return True

    return cfunc(_COLUMNS)(draw_columns)
