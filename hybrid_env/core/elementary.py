"""Logarithm, exponential, sine and cosine without branches, so that a loop over lanes compiles to
SIMD code. The polynomials are those of fdlibm (Sun Microsystems 1993), accurate to two units in the
last place.
"""

import math
from typing import Any

import numpy as np
from numba import types
from numba.extending import lower_builtin, type_callable

from hybrid_env.core.compilation import internal

# Ln 2 in two parts; the product of an exponent and the first is exact.
LOG_TWO_HIGH, LOG_TWO_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
# Bits of 1.0.
ONE = np.int64(0x3FF0000000000000)
# Adding 2^52 + 2^51 rounds a float to an integer in its low bits.
SHIFTER = 6755399441055744.0
SHIFTER_BITS = np.int64(0x4338000000000000)


def bits_of(x: float) -> np.int64:
    """Return the bits of a float64 as an int64."""
    return np.float64(x).view(np.int64)


def float_of(bits: np.int64) -> float:
    """Return the float64 with the bits of an int64."""
    return np.int64(bits).view(np.float64)


def _compile_cast(function: Any, result: Any, argument: Any) -> None:
    """Let numba compile a function to the instruction that takes bits as another type."""
    type_callable(function)(lambda _context: lambda _value: result)

    def cast(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], context.get_value_type(signature.return_type))

    lower_builtin(function, argument)(cast)


_compile_cast(bits_of, types.int64, types.float64)
_compile_cast(float_of, types.float64, types.int64)


@internal
def log(x: float) -> float:
    """Natural logarithm of a positive normal number; about -709 for zero, finite for negative
    numbers.
    """
    # Bits of sqrt(1/2).
    root_half = np.int64(0x3FE6A09E667F3BCD)
    bits = bits_of(x) + (ONE - root_half)
    # Of x over a mantissa in [sqrt(1/2), sqrt(2)), plus 1023.
    exponent = bits >> 52
    mantissa = float_of((bits & np.int64(0x000FFFFFFFFFFFFF)) + root_half)
    k = float_of(exponent + SHIFTER_BITS) - (SHIFTER + 1023.0)
    f = mantissa - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (
        3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01)
    )
    odd = w * (
        2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860510658591e-01)
    )
    odd = z * (6.666666666666735130e-01 + odd)
    square = 0.5 * f * f
    return k * LOG_TWO_HIGH - ((square - (s * (square + even + odd) + k * LOG_TWO_LOW)) - f)


@internal
def exp(x: float) -> float:
    """Exponential of a number between -700 and 700."""
    shifted = x * (1.0 / math.log(2.0)) + SHIFTER
    k = shifted - SHIFTER
    high = x - k * LOG_TWO_HIGH
    low = k * LOG_TWO_LOW
    r = high - low
    t = r * r
    terms = t * (
        6.61375632143793436117e-05
        + t * (-1.65339022054652515390e-06 + t * 4.13813679705723846039e-08)
    )
    c = r - t * (1.66666666666666019037e-01 + t * (-2.77777777770155933842e-03 + terms))
    mantissa = 1.0 - ((low - (r * c) / (2.0 - c)) - high)
    power = float_of((bits_of(shifted) - SHIFTER_BITS + 1023) << 52)
    return mantissa * power


@internal
def sine_cosine(x: float) -> tuple[float, float]:
    """Sine and cosine of an angle [rad]. The absolute error is of the order of 1e-16 (1 + |x|)."""
    shifted = x * (2.0 / math.pi) + SHIFTER
    k = shifted - SHIFTER
    quadrant = bits_of(shifted)
    # pi/2 in two parts; the 20 low bits of the first are zero.
    r = (x - k * 1.57079632673412561417e00) - k * 6.07710050650619224932e-11
    z = r * r
    terms = z * (
        2.75573137070700676789e-06
        + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    )
    terms = z * (8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + terms))
    sine = r + r * z * (-1.66666666666666324348e-01 + terms)
    half = 0.5 * z
    first = 1.0 - half
    terms = z * (
        -2.75573143513906633035e-07
        + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11)
    )
    terms = z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + terms))
    cosine = first + (((1.0 - first) - half) + z * z * (4.16666666666666019037e-02 + terms))
    swapped = (quadrant & 1) == 1
    s = cosine if swapped else sine
    c = sine if swapped else cosine
    s = -s if (quadrant & 2) == 2 else s
    c = -c if ((quadrant + 1) & 2) == 2 else c
    return s, c
