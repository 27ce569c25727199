"""The filters of heights of a bank whose modes climb or descend: beside that of the plane a
hypothesis has one of [z, vz] [m, m/s]. At a switch it begins at the height of the anchor with the
rate of its mode, which then changes by process noise alone:

    z' = z + tau vz,  vz' = vz + w,  w ~ N(0, climb_variance)

The height is measured with a normal error that is independent of those in the plane, so that the
log-likelihoods of both filters add up. Mixtures of filters, with unknown switches or with
`follow="bank"`, leave plane and height uncorrelated. A bank of modes that neither climb nor descend
has none of these filters, and others never have: the operations then do nothing. What they do
otherwise stays apart, so that the code of the plane is that without heights.
"""

import math
from typing import Any

from hybrid_env.core.arrays import FloatArray
from hybrid_env.core.banks.filter import LOG_TWO_PI, condition_x
from hybrid_env.core.compilation import apart, internal, selected, stay_apart
from hybrid_env.core.elementary import log
from hybrid_env.core.memory import four_of, write_lane
from hybrid_env.core.vectors import Vector, combination, minus_square, sandwich, widened

heights_of = selected(
    lambda bank: (lambda bank: bank.heights) if "heights" in bank.fields else (lambda bank: None)
)
"""Return the filters of heights of a bank, none if no mode climbs or descends; None where they are
never: the other functions then do nothing.
"""


@internal
def _moments(height: FloatArray, lane: int) -> Vector:
    """Return z, vz and their covariance zz, zv, vv of a filter, (7, LANES)."""
    return (*four_of(height, 0, lane), height[4, lane])


@internal
def begin_heights(heights: Any, bank: Any, block: Any, lane: int) -> None:
    """Begin the filters of a lane at the estimated height of the block."""
    if heights is None:
        return
    if len(heights) > 0:
        _begin(heights, bank, block, lane)


@apart
def _begin(heights: Any, bank: Any, block: Any, lane: int) -> None:
    """Do so where modes climb or descend."""
    stay_apart()
    height, variance = block.height_estimate[0, lane], block.height_variances[0, lane]
    block.anchor_height[lane] = height
    for h in range(len(heights)):
        rate = bank.motions[h].climb_rate
        write_lane(heights[h], lane, (height, rate, variance, 0.0, 0.0))


@internal
def step_heights(
    heights: Any,
    bank: Any,
    lowest: int,
    stop: int,
    first: int,
    last: int,
    measured: FloatArray,
    model: Any,
) -> None:
    """Advance filters lowest .. stop - 1 of lanes first .. last - 1 by one tick, and add to their
    log-likelihoods. measured: heights, (LANES,), NaN without one.
    """
    if heights is None:
        return
    if len(heights) > 0:
        _step(heights, bank, lowest, stop, first, last, measured, model)


@apart
def _step(
    heights: Any,
    bank: Any,
    lowest: int,
    stop: int,
    first: int,
    last: int,
    measured: FloatArray,
    model: Any,
) -> None:
    """Do so where modes climb or descend."""
    stay_apart()
    for h in range(lowest, stop):
        for lane in range(first, last):
            before = _moments(heights[h], lane)
            zz, zv, vv = sandwich(((1.0, model.tau), (0.0, 1.0)), before[2:])
            state = before[0] + model.tau * before[1], before[1]
            p = widened((zz, zv, vv + model.climb_variance))
            innovation, variance = measured[lane] - state[0], p[0] + model.height_variance
            if not math.isnan(innovation):
                gain, inverse = p[:2], 1.0 / variance
                distance = innovation * innovation * inverse
                added = -0.5 * (LOG_TWO_PI + log(variance) + distance)
                bank.hypotheses[h].log_likelihood[lane] += added
                state = combination((1.0, innovation * inverse), (state, gain))
                p = condition_x(p, gain, model.height_variance * inverse, inverse)
            write_lane(heights[h], lane, (*state, *p, innovation, variance))


@internal
def _mixture(heights: Any, bank: Any, lane: int, h: int, mixes: bool, scale: float) -> Vector:
    """Return mean and covariance of the mixture of the filters of a lane, of weights `likelihoods`
    times `scale`. With `mixes` mode h begins a tick with it, to which others bring their height
    alone. Differences to filter h lose no digits far from the origin.
    """
    z, vz = _moments(heights[h], lane)[:2]
    sums = (0.0, 0.0, 0.0, 0.0, 0.0)
    for g in range(len(heights)):
        of = _moments(heights[g], lane)
        if mixes and g != h:
            of = (of[0], bank.motions[h].climb_rate, of[2], 0.0, 0.0)
        difference = of[0] - z, of[1] - vz
        added = (*difference, *minus_square(of[2:], difference, -1.0))
        sums = combination((1.0, scale * bank.likelihoods[g, lane]), (sums, added))
    spread = minus_square(widened(sums[2:]), sums[:2], 1.0)
    return (z + sums[0], vz + sums[1], *spread)


@internal
def estimate_heights(
    heights: Any, bank: Any, block: Any, chosen: Any, first: int, last: int
) -> None:
    """Write estimates and their variances to the block. chosen: hypotheses, (LANES,); None merges
    all of them, after `posterior.compare`.
    """
    if heights is None:
        return
    if len(heights) > 0:
        _estimate(heights, bank, block, chosen, first, last)


@apart
def _estimate(heights: Any, bank: Any, block: Any, chosen: Any, first: int, last: int) -> None:
    """Do so where modes climb or descend."""
    stay_apart()
    for lane in range(first, last):
        if chosen is None:
            sums = bank.sums[0]
            moments = _mixture(heights, bank, lane, sums.likeliest[lane], False, sums.inverse[lane])
        else:
            moments = _moments(heights[chosen[lane]], lane)
        write_lane(block.height_estimate, lane, moments[:2])
        write_lane(block.height_variances, lane, (moments[2], moments[4]))


@apart
def mix_heights(bank: Any, h: int, first: int, last: int) -> None:
    """Write the mixed initial condition of the filter of mode h, of weights `likelihoods`."""
    stay_apart()
    for lane in range(first, last):
        write_lane(bank.mixed_heights[h], lane, _mixture(bank.heights, bank, lane, h, True, 1.0))


@internal
def step_mixed_heights(
    heights: Any, bank: Any, first: int, last: int, measured: FloatArray, model: Any
) -> None:
    """Do what `step_heights` does for all filters from their mixed initial conditions, and add to
    their log probabilities.
    """
    if heights is None:
        return
    if len(heights) > 0:
        _step_mixed(heights, bank, first, last, measured, model)


@apart
def _step_mixed(
    heights: Any, bank: Any, first: int, last: int, measured: FloatArray, model: Any
) -> None:
    """Do so where modes climb or descend."""
    stay_apart()
    for h in range(len(heights)):
        for lane in range(first, last):
            write_lane(heights[h], lane, _moments(bank.mixed_heights[h], lane))
        _step(heights, bank, h, h + 1, first, last, measured, model)
        kalman = bank.hypotheses[h]
        for lane in range(first, last):
            prior = bank.mixed[h].log_probability[lane]
            kalman.log_probability[lane] = prior + kalman.log_likelihood[lane]
