"""Habits of an object drawn anew for every episode: the law of its durations and of its next modes.

A law is the mixture of two humps with equal probability. A duration of a hump is offset + U + G
ticks, where U = 0, ..., span - 1 is uniform and G = 1, 2, ... geometric with a given mean; with a
mean of 1, G is 1. One law in five each is narrow (uniform, the longest duration 1 to 1.2 times the
shortest), wide (1.2 to 3 times), geometric (an offset of up to 80 ticks, which a third has not, and
a mean of 10 to 100), of two narrow humps, or different for straight motion and turns, each of one
of these kinds. The shortest uniform duration is 20 to 150 ticks. Ranges are uniform in the
logarithm, offsets uniform. A third of the orders has equally likely next modes; the others one
preferred next mode after each mode, with a probability of 0.5 to 1 above its equal share of the
rest.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.arrays import FloatArray
from hybrid_env.core.compilation import apart, internal, stay_apart
from hybrid_env.core.elementary import exp, log
from hybrid_env.core.noise import integer_below, uniform

NARROW, WIDE, GEOMETRIC, TWO_HUMPS, DIFFERENT = range(5)
# Of a hump.
OFFSET, SPAN, MEAN = range(3)


@internal
def _between(state: NDArray[np.uint64], lane: int, low: float, high: float) -> float:
    """Return a number that is uniform in its logarithm."""
    return low * exp(log(high / low) * uniform(state, lane))


@internal
def _draw_uniform(state: NDArray[np.uint64], lane: int, low: float, high: float, hump: Any) -> None:
    """Draw a uniform hump; low, high: of the longest over the shortest duration."""
    shortest = _between(state, lane, 20.0, 150.0)
    longest = shortest * _between(state, lane, low, high)
    hump[OFFSET] = math.floor(shortest) - 1.0
    hump[SPAN] = math.floor(longest) - math.floor(shortest) + 1.0
    hump[MEAN] = 1.0


@internal
def _draw_mode_law(state: NDArray[np.uint64], lane: int, kind: int, law: Any) -> None:
    """Draw the two humps of one mode, (2, 3)."""
    if kind == GEOMETRIC:
        law[0, OFFSET] = math.floor(80.0 * max(1.5 * uniform(state, lane) - 0.5, 0.0))
        law[0, SPAN] = 1.0
        law[0, MEAN] = _between(state, lane, 10.0, 100.0)
    elif kind == WIDE:
        _draw_uniform(state, lane, 1.2, 3.0, law[0])
    else:
        _draw_uniform(state, lane, 1.0, 1.2, law[0])
    if kind == TWO_HUMPS:
        _draw_uniform(state, lane, 1.0, 1.2, law[1])
    else:
        for k in range(3):
            law[1, k] = law[0, k]


@apart
def draw_law(state: NDArray[np.uint64], lane: int, law: FloatArray) -> None:
    """Draw the laws of straight motion and turns, (2, 2, 3): mode, hump, and offset, span and
    mean.
    """
    stay_apart()
    kind = integer_below(state, lane, 5)
    if kind == DIFFERENT:
        for turns in range(2):
            _draw_mode_law(state, lane, integer_below(state, lane, 4), law[turns])
    else:
        _draw_mode_law(state, lane, kind, law[0])
        for hump in range(2):
            for k in range(3):
                law[1, hump, k] = law[0, hump, k]


@apart
def draw_order(state: NDArray[np.uint64], lane: int, order: FloatArray) -> None:
    """Draw the probabilities of the next mode (column) by the present one, (M, M)."""
    stay_apart()
    modes = order.shape[0]
    strength = max(1.5 * uniform(state, lane) - 0.5, 0.0)
    strength = 0.5 + 0.5 * strength if strength > 0.0 else 0.0
    for mode in range(modes):
        other = integer_below(state, lane, modes - 1)
        preferred = other + (1 if other >= mode else 0)
        for k in range(modes):
            order[mode, k] = 0.0 if k == mode else (1.0 - strength) / (modes - 1)
        order[mode, preferred] += strength


@internal
def draw_from_law(state: NDArray[np.uint64], lane: int, law: FloatArray, longest: int) -> int:
    """Return a duration of a law of one mode, (2, 3), at most `longest` [ticks]."""
    hump = law[integer_below(state, lane, 2)]
    ticks = hump[OFFSET] + 1.0 + math.floor(hump[SPAN] * uniform(state, lane))
    if hump[MEAN] > 1.0:
        ticks += math.floor(log(1.0 - uniform(state, lane)) / log(1.0 - 1.0 / hump[MEAN]))
    return int(min(max(ticks, 1.0), longest))


@apart
def draw_remaining(state: NDArray[np.uint64], lane: int, law: FloatArray, longest: int) -> int:
    """Return the ticks left at a random moment of segments of one mode; arguments as in
    `draw_from_law`.
    """
    stay_apart()
    # The random moment is at least 1,000 ticks after the first switch.
    left = -1000 - integer_below(state, lane, 1000)
    while left <= 0:
        left += draw_from_law(state, lane, law, 1_000_000)
    return min(left, longest)


@apart
def draw_mode(state: NDArray[np.uint64], lane: int, probabilities: FloatArray) -> int:
    """Return a mode with the given probabilities, (M,)."""
    stay_apart()
    number = uniform(state, lane)
    last = 0
    for mode in range(probabilities.size):
        if probabilities[mode] > 0.0:
            # The last possible one, if the sum is below 1 by rounding.
            last = mode
            number -= probabilities[mode]
            if number < 0.0:
                break
    return last
