"""The observations as written by the kernel: float32 rows of six blocks of M values, one per
hypothesis, followed by scalars of the track. `hybrid_env.observation.Layout` reads them by name.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.banks.bank import estimate_of, likeliest, mode_type
from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.elementary import exp, log
from hybrid_env.core.memory import FloatArray, Records
from hybrid_env.core.motion import heading_vector

# Lower clip of log-likelihood ratios and log-probabilities.
LOG_FLOOR = -30.0
# Clip of the magnitude of whitened innovations.
LARGEST = 1e6
# Clip of the values of the anchor, so that those of a diverged filter fit in a float32.
LARGEST_ANCHOR = 1e30
# Smaller log-likelihood ratios do not change a clipped log-probability.
NEGLIGIBLE = -100.0

# Scales that bring typical values to the order of one.
LOG_SCALE = 0.1
TICK_SCALE = 0.01
LENGTH_SCALE = 0.1

HYPOTHESIS_FEATURES = {
    "log_ratio": LOG_SCALE,
    "innovation_along": 1.0,
    "innovation_across": 1.0,
    "log_variance": 1.0,
    "previous": 1.0,
    "curvature": 1.0,
}
"""Names of the blocks of M values, in order, and the scale that multiplies each of them."""

TRACK_FEATURES = {
    "ticks": TICK_SCALE,
    "ticks_left": TICK_SCALE,
    "log_error_probability": LOG_SCALE,
    "speed": 1.0,
    "displacement_along": LENGTH_SCALE,
    "displacement_across": LENGTH_SCALE,
    "anchor_xx": 1.0,
    "anchor_xv": 1.0,
    "anchor_vv": 1.0,
    "log_noise": 1.0,
}
"""Names of the scalars after the blocks, in order, and the scale that multiplies each of them."""

QUICKEST_HYPOTHESIS_FEATURES = {
    "log_probability": LOG_SCALE,
    "log_ratio": 1.0,
    "innovation_along": 1.0,
    "innovation_across": 1.0,
    "log_variance": 1.0,
    "stated": 1.0,
}
# The same with unknown switches.
QUICKEST_TRACK_FEATURES = {"speed": 1.0, "stated_ticks": TICK_SCALE}

RAW_FEATURES = {
    "displacement_along": LENGTH_SCALE,
    "displacement_across": LENGTH_SCALE,
    "measured": 1.0,
    "ticks": TICK_SCALE,
    "ticks_left": TICK_SCALE,
    "speed": 1.0,
    "log_noise": 1.0,
}
"""Names of the scalars of a row without the bank, and their scales."""

STATE_FEATURES = {
    "position_along": LENGTH_SCALE,
    "position_across": LENGTH_SCALE,
    "velocity_along": 1.0,
    "velocity_across": 1.0,
    "ticks": TICK_SCALE,
    "ticks_left": TICK_SCALE,
    "log_noise": 1.0,
}
"""Names of the scalars of a row of the true state, after the one-hot encoding of the true mode,
and their scales.
"""

OBSERVATIONS = ("bank", "raw", "state")
"""What a row holds: the output of the bank, the measurement alone, or the true state."""
BANK_ROW, RAW_ROW, STATE_ROW = range(len(OBSERVATIONS))

BLOCKS, SINGLES = len(HYPOTHESIS_FEATURES), len(TRACK_FEATURES)
TICKS, TICKS_LEFT, LOG_ERROR, SPEED, ALONG, ACROSS, ANCHOR_XX, ANCHOR_XV, ANCHOR_VV, LOG_NOISE = (
    range(SINGLES)
)


@inlined
def heading_frame(x: float, y: float, heading_x: float, heading_y: float) -> tuple[float, float]:
    """Return the components of a vector along and across a heading; across is positive to the
    left.
    """
    return heading_x * x + heading_y * y, heading_x * y - heading_y * x


@inlined
def clipped_innovation(white: float) -> float:
    """Return a whitened innovation clipped to +-`LARGEST`."""
    return max(min(white, LARGEST), -LARGEST)


@inlined
def innovation_in_frame(
    innovation: Any,
    lane: int,
    heading_x: float,
    heading_y: float,
) -> tuple[float, float]:
    """Return the clipped whitened innovation of one lane along and across a heading."""
    return heading_frame(
        clipped_innovation(innovation.white_x[lane]),
        clipped_innovation(innovation.white_y[lane]),
        heading_x,
        heading_y,
    )


@inlined
def log_error_probability(others: float) -> float:
    """Return ln(1 - maximum posterior), equal priors, clipped; others: likelihoods of the others
    over the largest.
    """
    return max(log(others / (1.0 + others)), LOG_FLOOR)


@inlined
def mean_over_noise(value_x: float, value_y: float, variance_x: float, variance_y: float) -> float:
    """Return the mean over the axes of (covariance entry / R), clipped to +-`LARGEST_ANCHOR`."""
    mean = 0.5 * (value_x / variance_x + value_y / variance_y)
    return max(min(mean, LARGEST_ANCHOR), -LARGEST_ANCHOR)


@internal
def write_segment(
    row: NDArray[np.float32],
    block: Any,
    lane: int,
    radii: FloatArray,
    setting: Any,
) -> None:
    """Write the values that are constant over a segment. row: (6 M + 10,); setting: record
    `PARAMETERS`.
    """
    n = radii.size
    M = 2 * n + 1
    for h in range(M):
        row[4 * M + h] = 1.0 if h == block.active_mode[lane] else 0.0
    row[5 * M] = 0.0
    for c in range(n):
        row[5 * M + 1 + c] = 1.0 / radii[c]
        row[5 * M + 1 + n + c] = -1.0 / radii[c]
    singles = row[BLOCKS * M :]
    kept, variance_x, variance_y = block.covariance, setting.variance_x, setting.variance_y
    singles[SPEED] = min(block.speed[lane], LARGEST_ANCHOR)
    singles[ANCHOR_XX] = max(
        mean_over_noise(kept[0, lane], kept[7, lane], variance_x, variance_y),
        0.0,
    )
    singles[ANCHOR_XV] = mean_over_noise(kept[1, lane], kept[8, lane], variance_x, variance_y)
    singles[ANCHOR_VV] = max(
        mean_over_noise(kept[4, lane], kept[9, lane], variance_x, variance_y),
        0.0,
    )
    singles[LOG_NOISE] = setting.log_noise


@inlined
def compare_hypotheses(scratch: Any, hypotheses: Records, first: int, last: int) -> None:
    """Compute the maximum log-likelihood and the log error probability of lanes first .. last -
    1.
    """
    for lane in range(first, last):
        scratch.largest[lane] = hypotheses[0].log_likelihood[lane]
        scratch.log_error[lane] = 0.0
        # The most likely hypothesis is counted below.
        scratch.ties[lane] = -1.0
    for h in range(1, hypotheses.size):
        kalman = hypotheses[h]
        for lane in range(first, last):
            scratch.largest[lane] = max(scratch.largest[lane], kalman.log_likelihood[lane])
    for h in range(hypotheses.size):
        kalman = hypotheses[h]
        for lane in range(first, last):
            ratio = kalman.log_likelihood[lane] - scratch.largest[lane]
            # Ties are counted separately: a sum with 1 would lose the digits of small terms.
            below = ratio < 0.0
            scratch.log_error[lane] += exp(max(ratio, NEGLIGIBLE)) if below else 0.0
            scratch.ties[lane] += 0.0 if below else 1.0
    for lane in range(first, last):
        scratch.log_error[lane] = log_error_probability(
            scratch.log_error[lane] + scratch.ties[lane]
        )


@inlined
def compare_types(scratch: Any, hypotheses: Records, first: int, last: int) -> None:
    """Compute the log error probability of the likeliest type (straight, left or right) of lanes
    first
    .. last - 1, after `compare_hypotheses`.
    """
    for lane in range(first, last):
        for of_type in range(3):
            scratch.types[of_type, lane] = 0.0
    for h in range(hypotheses.size):
        kalman = hypotheses[h]
        of_type = mode_type(h, hypotheses.size // 2)
        for lane in range(first, last):
            ratio = kalman.log_likelihood[lane] - scratch.largest[lane]
            scratch.types[of_type, lane] += exp(max(ratio, NEGLIGIBLE))
    for lane in range(first, last):
        straight = scratch.types[0, lane]
        left = scratch.types[1, lane]
        right = scratch.types[2, lane]
        # The sum of the two smaller ones is not a difference, which would lose the digits of small
        # terms.
        others = min(straight + left, straight + right, left + right)
        scratch.log_type_error[lane] = log_error_probability(others / max(straight, left, right))


@inlined
def mask_declarations(mask: NDArray[np.int8], scratch: Any, lane: int, setting: Any) -> None:
    """Write whether declarations count, (actions,): the posterior of a mode, or of a type,
    reaches `evidence`.
    """
    log_error = scratch.log_error[lane] if setting.exact else scratch.log_type_error[lane]
    # A comparison with NaN is False, so that a declaration counts.
    early = log_error > setting.log_error_allowed
    for action in range(1, mask.size):
        mask[action] = 0 if early else 1


@internal
def write_twin(row: NDArray[np.float32], block: Any, lane: int, setting: Any) -> None:
    """Write the row of a track at a tick where it is not that of the bank."""
    if setting.observation == RAW_ROW:
        write_raw(row, block, lane, setting)
    else:
        write_state(row, block, lane, setting)


@internal
def write_raw(row: NDArray[np.float32], block: Any, lane: int, setting: Any) -> None:
    """Write the measurement relative to the anchor and the time: the row without the bank, see
    `RAW_FEATURES`.
    """
    x = block.measurement[0, lane]
    y = block.measurement[1, lane]
    missing = math.isnan(x)
    from_x = 0.0 if missing else (x - block.anchor[0, lane]) * setting.noise_whitener
    from_y = 0.0 if missing else (y - block.anchor[2, lane]) * setting.noise_whitener
    along, across = heading_frame(from_x, from_y, block.heading[0, lane], block.heading[1, lane])
    row[0], row[1] = LENGTH_SCALE * along, LENGTH_SCALE * across
    row[2] = 0.0 if missing else 1.0
    row[3] = TICK_SCALE * block.tick[lane]
    row[4] = TICK_SCALE * (block.length[lane] - block.tick[lane])
    row[5] = min(block.speed[lane], LARGEST_ANCHOR)
    row[6] = setting.log_noise


@internal
def write_state(row: NDArray[np.float32], block: Any, lane: int, setting: Any) -> None:
    """Write the true mode and the true state relative to the anchor: the row of a problem that is
    fully observed, see `STATE_FEATURES`.
    """
    modes = setting.modes
    for mode in range(modes):
        row[mode] = 1.0 if mode == block.true_mode[lane] else 0.0
    singles = row[modes:]
    heading_x = block.heading[0, lane]
    heading_y = block.heading[1, lane]
    from_x = (block.truth[0, lane] - block.anchor[0, lane]) * setting.noise_whitener
    from_y = (block.truth[2, lane] - block.anchor[2, lane]) * setting.noise_whitener
    along, across = heading_frame(from_x, from_y, heading_x, heading_y)
    singles[0], singles[1] = LENGTH_SCALE * along, LENGTH_SCALE * across
    singles[2], singles[3] = heading_frame(
        block.truth[1, lane],
        block.truth[3, lane],
        heading_x,
        heading_y,
    )
    singles[4] = TICK_SCALE * block.tick[lane]
    singles[5] = TICK_SCALE * (block.length[lane] - block.tick[lane])
    singles[6] = setting.log_noise


@internal
def write_tick(
    row: NDArray[np.float32],
    block: Any,
    lane: int,
    scratch: Any,
    bank: Any,
    setting: Any,
) -> None:
    """Write the values of a row, (6 M + 10,), that change with every tick, after
    `compare_hypotheses`.
    """
    M = bank.hypotheses.size
    heading_x = block.heading[0, lane]
    heading_y = block.heading[1, lane]
    for h in range(M):
        kalman = bank.hypotheses[h]
        innovation = bank.innovations[h]
        row[h] = LOG_SCALE * max(kalman.log_likelihood[lane] - scratch.largest[lane], LOG_FLOOR)
        row[M + h], row[2 * M + h] = innovation_in_frame(innovation, lane, heading_x, heading_y)
        # Negative only by rounding.
        row[3 * M + h] = max(innovation.log_variance[lane] - setting.log_noise, 0.0)
    singles = row[BLOCKS * M :]
    singles[TICKS] = TICK_SCALE * block.tick[lane]
    singles[TICKS_LEFT] = TICK_SCALE * (block.length[lane] - block.tick[lane])
    singles[LOG_ERROR] = LOG_SCALE * scratch.log_error[lane]
    x = block.measurement[0, lane]
    y = block.measurement[1, lane]
    # The position that the likeliest filter expects.
    if setting.irregular and math.isnan(x):
        x, _, y, _ = estimate_of(bank.hypotheses, likeliest(bank.hypotheses, lane), lane)
    along, across = heading_frame(
        (x - block.anchor[0, lane]) * setting.noise_whitener,
        (y - block.anchor[2, lane]) * setting.noise_whitener,
        heading_x,
        heading_y,
    )
    singles[ALONG] = LENGTH_SCALE * along
    singles[ACROSS] = LENGTH_SCALE * across


@internal
def write_quickest_row(
    row: NDArray[np.float32],
    block: Any,
    lane: int,
    bank: Any,
    setting: Any,
) -> None:
    """Write the observation of a track with unknown switches, (6 M + 2,)."""
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
    row[6 * M] = min(speed, LARGEST_ANCHOR)
    row[6 * M + 1] = TICK_SCALE * block.stated_ticks[lane]
