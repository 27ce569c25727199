"""The filters of heights of a bank whose modes climb or descend: beside that of the plane a
hypothesis has one of [z, vz] [m, m/s]. At a switch it begins at the height of the anchor with the
rate of its mode, which then changes by process noise alone:

    z' = z + tau vz,  vz' = vz + w,  w ~ N(0, climb_variance)

The height is measured with an error that is independent of those in the plane, so that the
log-likelihoods of both filters add up. With unknown switches they are mixed as those of the plane,
see `imm`. A bank of modes that neither climb nor descend has none of these filters, and others
never have: the operations then do nothing.
"""

import math
from typing import Any

from hybrid_env.core.banks.filter import LOG_TWO_PI, condition_x
from hybrid_env.core.compilation import formula, internal, seldom, selected, stay_apart
from hybrid_env.core.elementary import exp, log
from hybrid_env.core.memory import write_lane
from hybrid_env.core.vectors import combination, minus_square, sandwich

# Smaller log probabilities count as this one.
NEGLIGIBLE = -700.0

Rising = tuple[tuple[float, float], tuple[float, float, float]]
"""[z, vz] and its covariance zz, zv, vv."""


def where_heights(operation: Any) -> Any:
    """Return an operation that does nothing if a bank, its first argument, never has heights."""

    def call(bank: Any, *arguments: Any) -> None:
        operation(bank, *arguments)

    def nothing(bank: Any, *arguments: Any) -> None:
        pass

    return selected(lambda bank: call if "heights" in bank.fields else nothing)


@formula
def _read(kalman: Any, lane: int) -> Rising:
    """Return state and covariance of a filter."""
    p = kalman.covariance
    return (kalman.state[0, lane], kalman.state[1, lane]), (p[0, lane], p[1, lane], p[2, lane])


@formula
def _write(kalman: Any, lane: int, rising: Rising) -> None:
    """Set state and covariance of a filter."""
    write_lane(kalman.state, lane, rising[0])
    write_lane(kalman.covariance, lane, rising[1])


@seldom
def _begin(bank: Any, block: Any, lane: int, exact: bool) -> None:
    """Begin the filters of a lane at the estimated height of the block, or with `exact` at the true
    one.
    """
    stay_apart()
    height = block.true_height[0, lane] if exact else block.height_estimate[0, lane]
    block.anchor_height[lane] = height
    variance = 0.0 if exact else block.height_covariance[0, lane]
    for h in range(bank.heights.size):
        state = height, bank.motions[h].climb_rate
        _write(bank.heights[h], lane, (state, (variance, 0.0, 0.0)))


@internal
def _step_filter(kalman: Any, begun: Any, lane: int, measured: Any, model: Any) -> float:
    """Advance a filter by one tick from the state of `begun`; return the log-likelihood of the
    measured height, 0 without one. With a freedom > 0 it is that of `sensing`.
    """
    (z, vz), p = _read(begun, lane)
    zz, zv, vv = sandwich(((1.0, model.tau), (0.0, 1.0)), p)
    z += model.tau * vz
    vv += model.climb_variance
    variance = zz + model.height_variance
    seen = not math.isnan(measured.height[lane])
    innovation = measured.height[lane] - z if seen else 0.0
    distance = innovation * innovation / variance
    likelihood, weight = -0.5 * distance, 1.0
    if model.freedom > 0.0:
        likelihood = -0.5 * (model.freedom + 1.0) * log(1.0 + distance / model.freedom)
        weight = min((model.freedom + 1.0) / (model.freedom + distance), 1.0)
    # Without a measurement nothing changes.
    inverse = 1.0 / variance if seen else 0.0
    left = model.height_variance * inverse if seen else 1.0
    moved = weight * inverse * innovation
    # Bounded below, as in the published bank.
    least = zv * inverse * zv * inverse * model.height_variance
    after_zz, after_zv, after_vv = condition_x((zz, zv, vv), (zz, zv), left, inverse)
    state = z + zz * moved, vz + zv * moved
    _write(kalman, lane, (state, (after_zz, after_zv, max(after_vv, least))))
    kalman.innovation[lane], kalman.variance[lane] = innovation, variance
    return likelihood - 0.5 * (LOG_TWO_PI + log(variance)) if seen else 0.0


@seldom
def _step(
    bank: Any, lowest: int, stop: int, first: int, last: int, measured: Any, model: Any
) -> None:
    """Advance filters lowest .. stop - 1 of lanes first .. last - 1 by one tick, and add to their
    log-likelihoods. measured: a record with the fields of `memory.HEIGHT_FIELDS`.
    """
    stay_apart()
    for h in range(bank.heights.size):
        if h < lowest or h >= stop:
            continue
        kalman = bank.heights[h]
        for lane in range(first, last):
            added = _step_filter(kalman, kalman, lane, measured, model)
            bank.hypotheses[h].log_likelihood[lane] += added


@internal
def _mixture(bank: Any, lane: int, mode: int, scale: float) -> Rising:
    """Return the mixture of the filters of a lane, of weights `likelihoods` times `scale`, in which
    a mode begins a tick: to it the others bring their height alone. -1 is no mode.
    """
    rate = bank.motions[max(mode, 0)].climb_rate
    about, mean, spread = _read(bank.heights[max(mode, 0)], lane)[0], (0.0, 0.0), (0.0, 0.0, 0.0)
    for again in range(2):
        for g in range(bank.heights.size):
            weight = scale * bank.likelihoods[g, lane]
            state, p = _read(bank.heights[g], lane)
            if mode >= 0 and g != mode:
                state, p = (state[0], rate), (p[0], 0.0, 0.0)
            # Differences lose no digits far from the origin.
            difference = combination((1.0, -1.0), (state, about))
            if again == 0:
                mean = combination((1.0, weight), (mean, difference))
            else:
                square = minus_square(p, difference, -1.0)
                spread = combination((1.0, weight), (spread, square))
        if again == 0:
            about = combination((1.0, 1.0), (about, mean))
    return about, spread


@seldom
def _merge(bank: Any, block: Any, first: int, last: int) -> None:
    """Write mean and covariance of the mixture to the block, after `posterior.compare`."""
    stay_apart()
    if bank.heights.size > 0:
        for lane in range(first, last):
            mean, spread = _mixture(bank, lane, -1, bank.sums[0].inverse[lane])
            write_lane(block.height_estimate, lane, mean)
            write_lane(block.height_covariance, lane, spread)


@seldom
def _follow(bank: Any, block: Any, chosen: int, lane: int) -> None:
    """Write the estimate of one hypothesis to the block, and its covariance."""
    stay_apart()
    if bank.heights.size > 0:
        state, p = _read(bank.heights[chosen], lane)
        write_lane(block.height_estimate, lane, state)
        write_lane(block.height_covariance, lane, p)


@seldom
def _mix(bank: Any, first: int, last: int) -> None:
    """Write the mixed initial conditions of a tick, after those of the plane."""
    stay_apart()
    modes = bank.heights.size
    for h in range(modes):
        for lane in range(first, last):
            for g in range(modes):
                before = max(bank.hypotheses[g].log_probability[lane], NEGLIGIBLE)
                share = exp(before - bank.mixed[h].log_probability[lane])
                bank.likelihoods[g, lane] = bank.transitions[g, h] * share
            _write(bank.mixed_heights[h], lane, _mixture(bank, lane, h, 1.0))


@seldom
def _step_mixed(bank: Any, first: int, last: int, measured: Any, model: Any) -> None:
    """Advance all filters from their mixed initial conditions, as those of the plane before."""
    stay_apart()
    for h in range(bank.heights.size):
        kalman = bank.hypotheses[h]
        for lane in range(first, last):
            mixed = bank.mixed_heights[h]
            added = _step_filter(bank.heights[h], mixed, lane, measured, model)
            kalman.log_likelihood[lane] += added
            kalman.log_probability[lane] += added


begin_heights, step_heights, merge_heights = map(where_heights, (_begin, _step, _merge))
follow_height, mix_heights, step_mixed_heights = map(where_heights, (_follow, _mix, _step_mixed))
