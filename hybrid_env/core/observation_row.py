"""The observations as written by the kernel: float32 rows of six blocks of M values, one per
hypothesis, followed by scalars of the track. `hybrid_env.observation.Layout` reads them by name.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.arrays import Float32Array, FloatArray
from hybrid_env.core.banks.bank import estimate_of, likeliest
from hybrid_env.core.compilation import apart, inlined, internal, stay_apart
from hybrid_env.core.elementary import log
from hybrid_env.core.memory import state_of
from hybrid_env.core.motion import heading_vector

# Lower clip of log-likelihood ratios and log-probabilities.
LOG_FLOOR = -30.0
# Clip of the values of the anchor, so that those of a diverged filter fit in a float32.
LARGEST_ANCHOR = 1e30

# Scales that bring typical values to the order of one.
LOG_SCALE = 0.1
VELOCITY_SCALE = 10.0
TICK_SCALE = 0.01
LENGTH_SCALE = 0.1

OBSERVATIONS = ("bank", "raw", "state", "innovations")
"""What a row holds: the output of the bank, the measurement alone, the true state, or the
innovations alone.
"""
BANK_ROW, RAW_ROW, STATE_ROW, INNOVATIONS_ROW = range(len(OBSERVATIONS))


@internal
def heading_frame(x: float, y: float, heading_x: float, heading_y: float) -> tuple[float, float]:
    """Return the components of a vector along and across a heading; across is positive to the
    left.
    """
    return heading_x * x + heading_y * y, heading_x * y - heading_y * x


@inlined
def innovation_in_frame(
    innovation: Any, lane: int, heading_x: float, heading_y: float
) -> tuple[float, float]:
    """Return the whitened innovation of one lane along and across a heading, clipped to a million
    in x and y.
    """
    x = max(min(innovation.white_x[lane], 1e6), -1e6)
    y = max(min(innovation.white_y[lane], 1e6), -1e6)
    return heading_frame(x, y, heading_x, heading_y)


@internal
def _displacement(block: Any, lane: int, x: float, y: float, setting: Any) -> tuple[float, float]:
    """Return a position relative to the anchor over sqrt(R), along and across its heading,
    scaled.
    """
    along, across = heading_frame(
        (x - block.anchor[0, lane]) * setting.noise_whitener,
        (y - block.anchor[2, lane]) * setting.noise_whitener,
        block.heading[0, lane],
        block.heading[1, lane],
    )
    return LENGTH_SCALE * along, LENGTH_SCALE * across


@internal
def _measured(block: Any, lane: int, setting: Any) -> float:
    """Return 1 if the present tick has a measurement, else 0."""
    return 0.0 if setting.irregular and math.isnan(block.measurement[0, lane]) else 1.0


@internal
def _log_noise(block: Any, lane: int, setting: Any) -> float:
    """Return ln of the variance of the measurement over R, mean of the axes; 0 without one."""
    if not setting.irregular or math.isnan(block.measurement[0, lane]):
        return 0.0
    return 0.5 * log(max(block.noise[0, lane] * block.noise[2, lane], 1e-300))


@inlined
def log_error_probability(others: float) -> float:
    """Return ln(1 - maximum posterior), equal priors, clipped; others: likelihoods of the others
    over the largest.
    """
    return max(log(others / (1.0 + others)), LOG_FLOOR)


@internal
def mean_over_noise(value_x: float, value_y: float, variance_x: float, variance_y: float) -> float:
    """Return the mean over the axes of (covariance entry / R), clipped to +-`LARGEST_ANCHOR`."""
    mean = 0.5 * (value_x / variance_x + value_y / variance_y)
    return max(min(mean, LARGEST_ANCHOR), -LARGEST_ANCHOR)


@internal
def write_trace(trace: FloatArray, block: Any, lane: int, active_mode: int) -> None:
    """Add the present tick to a stored trace, (rows, columns), as long as it has room."""
    if trace.shape[0] > 0 and block.trace_length[lane] < trace.shape[0]:
        row = trace[block.trace_length[lane]]
        for k in range(4):
            row[k] = block.truth[k, lane]
        row[4], row[5] = block.measurement[0, lane], block.measurement[1, lane]
        row[6], row[7] = block.estimate[0, lane], block.estimate[2, lane]
        row[8], row[9], row[10] = active_mode, block.segment[lane], block.true_mode[lane]
        row[11], row[12] = block.true_height[0, lane], block.height[lane]
        row[13] = block.height_estimate[0, lane]
        block.trace_length[lane] += 1


@internal
def write_segment(
    row: Float32Array, block: Any, lane: int, curvatures: FloatArray, setting: Any
) -> None:
    """Write the values that are constant over a segment. row: (6 M + 11,); curvatures: (M,) [1/m];
    setting: record `PARAMETERS`.
    """
    M = curvatures.size
    way = setting.tau * block.speed[lane]
    for h in range(M):
        row[4 * M + h] = 1.0 if h == block.active_mode[lane] else 0.0
        row[5 * M + h] = min(max(way * curvatures[h], -LARGEST_ANCHOR), LARGEST_ANCHOR)
    # In the order of `Layout.track_features`.
    singles = row[6 * M :]
    kept, variance_x, variance_y = block.covariance, setting.variance_x, setting.variance_y
    singles[3] = min(way * setting.noise_whitener, LARGEST_ANCHOR)
    ticks = VELOCITY_SCALE * setting.tau
    xx = mean_over_noise(kept[0, lane], kept[7, lane], variance_x, variance_y)
    vv = mean_over_noise(kept[4, lane], kept[9, lane], variance_x, variance_y)
    xv = mean_over_noise(kept[1, lane], kept[8, lane], variance_x, variance_y)
    singles[6] = max(xx, 0.0)
    singles[7] = min(max(ticks * xv, -LARGEST_ANCHOR), LARGEST_ANCHOR)
    singles[8] = min(max(ticks * ticks * vv, 0.0), LARGEST_ANCHOR)


@inlined
def mask_declarations(mask: NDArray[np.int8], others: float, setting: Any) -> None:
    """Write whether declarations count, (actions,): the posterior of a mode, or of a type,
    reaches `evidence`. others: as in `log_error_probability`.
    """
    # A comparison with NaN is False, so that a declaration counts.
    early = log_error_probability(others) > setting.log_error_allowed
    for action in range(1, mask.size):
        mask[action] = 0 if early else 1


@apart
def write_twin(row: Float32Array, block: Any, lane: int, bank: Any, setting: Any) -> None:
    """Write the row of a track at a tick where it is not that of the bank: the measurement alone,
    see `RawLayout`; the true mode and state, of a problem that is fully observed, see
    `StateLayout`; or the innovations alone, see `InnovationsLayout`.
    """
    stay_apart()
    ticks = TICK_SCALE * block.tick[lane]
    ticks_left = TICK_SCALE * (block.length[lane] - block.tick[lane])
    if setting.observation == RAW_ROW:
        x, y = block.measurement[0, lane], block.measurement[1, lane]
        if math.isnan(x):
            x, y = block.anchor[0, lane], block.anchor[2, lane]
        row[0], row[1] = _displacement(block, lane, x, y, setting)
        row[2] = _measured(block, lane, setting)
        row[3], row[4] = ticks, ticks_left
        row[5] = min(setting.tau * block.speed[lane] * setting.noise_whitener, LARGEST_ANCHOR)
        row[6] = _log_noise(block, lane, setting)
        return
    modes = setting.modes
    if setting.observation == INNOVATIONS_ROW:
        heading_x, heading_y = block.heading[0, lane], block.heading[1, lane]
        for h in range(modes):
            row[h], row[modes + h] = innovation_in_frame(
                bank.innovations[h], lane, heading_x, heading_y
            )
            row[2 * modes + h] = 1.0 if h == block.active_mode[lane] else 0.0
        singles = row[3 * modes :]
        singles[0], singles[1] = ticks, ticks_left
        singles[2] = _measured(block, lane, setting)
        return
    for mode in range(modes):
        row[mode] = 1.0 if mode == block.true_mode[lane] else 0.0
    singles = row[modes:]
    x, u, y, v = state_of(block.truth, lane)
    singles[0], singles[1] = _displacement(block, lane, x, y, setting)
    per_tick = setting.tau * setting.noise_whitener
    singles[2], singles[3] = heading_frame(
        per_tick * u, per_tick * v, block.heading[0, lane], block.heading[1, lane]
    )
    singles[4], singles[5] = ticks, ticks_left
    singles[6] = _log_noise(block, lane, setting)


@internal
def write_tick(
    row: Float32Array, block: Any, lane: int, scratch: Any, bank: Any, setting: Any
) -> None:
    """Write the values of a row, (6 M + 11,), that change with every tick, after
    `posterior.compare`.
    """
    M = bank.hypotheses.size
    largest = bank.sums[0].largest[lane]
    heading_x = block.heading[0, lane]
    heading_y = block.heading[1, lane]
    for h in range(M):
        kalman = bank.hypotheses[h]
        innovation = bank.innovations[h]
        row[h] = LOG_SCALE * max(kalman.log_likelihood[lane] - largest, LOG_FLOOR)
        row[M + h], row[2 * M + h] = innovation_in_frame(innovation, lane, heading_x, heading_y)
        # Negative only by rounding.
        row[3 * M + h] = max(innovation.log_variance[lane] - setting.log_noise, 0.0)
    singles = row[6 * M :]
    singles[0] = TICK_SCALE * block.tick[lane]
    singles[1] = TICK_SCALE * (block.length[lane] - block.tick[lane])
    singles[2] = LOG_SCALE * scratch.log_error[lane]
    x = block.measurement[0, lane]
    y = block.measurement[1, lane]
    # The position that the likeliest filter expects.
    if setting.irregular and math.isnan(x):
        x, _, y, _ = estimate_of(bank.hypotheses, likeliest(bank.hypotheses, lane), lane)
    singles[4], singles[5] = _displacement(block, lane, x, y, setting)
    singles[9] = _log_noise(block, lane, setting)
    singles[10] = _measured(block, lane, setting)


@internal
def write_quickest_row(row: Float32Array, block: Any, lane: int, bank: Any, setting: Any) -> None:
    """Write the observation of a track with unknown switches, (6 M + 3,)."""
    M = bank.hypotheses.size
    speed, heading_x, heading_y = heading_vector(block.estimate[1, lane], block.estimate[3, lane])
    largest = bank.hypotheses[0].log_likelihood[lane]
    for h in range(1, M):
        largest = max(largest, bank.hypotheses[h].log_likelihood[lane])
    for h in range(M):
        kalman = bank.hypotheses[h]
        innovation = bank.innovations[h]
        # Positive only by rounding.
        row[h] = LOG_SCALE * min(max(kalman.log_probability[lane], LOG_FLOOR), 0.0)
        row[M + h] = max(kalman.log_likelihood[lane] - largest, LOG_FLOOR)
        row[2 * M + h], row[3 * M + h] = innovation_in_frame(innovation, lane, heading_x, heading_y)
        row[4 * M + h] = max(innovation.log_variance[lane] - setting.log_noise, 0.0)
        row[5 * M + h] = (
            1.0 if block.stated_ticks[lane] > 0 and block.stated_mode[lane] == h else 0.0
        )
    row[6 * M] = min(setting.tau * speed * setting.noise_whitener, LARGEST_ANCHOR)
    row[6 * M + 1] = TICK_SCALE * block.stated_ticks[lane]
    row[6 * M + 2] = _measured(block, lane, setting)


@internal
def write_heights(heights: Any, row: Float32Array, block: Any, lane: int, setting: Any) -> None:
    """Write the values at the end of a row that modes with a climb have besides, in the order of
    `Layout.height_features`.
    """
    if heights is None:
        return
    if len(heights) > 0 and setting.observation != STATE_ROW:
        _write_heights(heights, row, block, lane, setting)


@apart
def _write_heights(heights: Any, row: Float32Array, block: Any, lane: int, setting: Any) -> None:
    """Do so where modes climb or descend."""
    stay_apart()
    M, last, kind = len(heights), setting.width - 1, setting.observation
    whitener = 1.0 / math.sqrt(setting.height_variance)
    if kind == RAW_ROW:
        shift = LENGTH_SCALE * whitener * (block.height[lane] - block.anchor_height[lane])
        row[last] = 0.0 if math.isnan(shift) else shift
        return
    row[last] = setting.tau * whitener * block.height_estimate[1, lane]
    up = row[last - 2 * M if kind == BANK_ROW else last + 1 - M :]
    for h in range(M):
        innovation, variance = heights[h, 5, lane], heights[h, 6, lane]
        up[h] = 0.0 if math.isnan(innovation) else innovation / math.sqrt(variance)
        if kind == BANK_ROW:
            up[M + h] = max(log(variance * whitener * whitener), 0.0)
