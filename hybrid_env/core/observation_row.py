"""The row that a policy reads, as the kernel writes it. `hybrid_env.observation.Layout` reads it by name.

One flat float32 row holds six blocks of M numbers, one number per hypothesis, then ten numbers of the track.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import formula, internal
from hybrid_env.core.elementary import exp, log

LOG_FLOOR = -30.0  # log-likelihood ratios and log-probabilities are clipped here
LARGEST = 1e6  # innovations over their deviation are clipped here
NEGLIGIBLE = -100.0  # exp of less changes no clipped log-probability

# scales that bring the usual values to the order of one
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
"""Blocks of M numbers in this order, each with the scale that it is multiplied by in the row."""

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
"""Single numbers behind the blocks, each with its scale."""

BLOCKS, SINGLES = len(HYPOTHESIS_FEATURES), len(TRACK_FEATURES)
TICKS, TICKS_LEFT, LOG_ERROR, SPEED, ALONG, ACROSS, ANCHOR_XX, ANCHOR_XV, ANCHOR_VV, LOG_NOISE = range(
    SINGLES
)


@formula
def heading_frame(x: float, y: float, heading_x: float, heading_y: float) -> tuple[float, float]:
    """A vector seen in a heading: its parts along and across, which is positive to the left."""
    return heading_x * x + heading_y * y, heading_x * y - heading_y * x


@formula
def clipped_innovation(white: float) -> float:
    """An innovation over its standard deviation, clipped at +-`LARGEST`."""
    return max(min(white, LARGEST), -LARGEST)


@formula
def log_error_probability(others: float) -> float:
    """ln(1 - largest posterior) for equal priors, clipped at `LOG_FLOOR`.

    others: sum of the likelihoods of all other hypotheses over that of the likeliest one.
    """
    return max(log(others / (1.0 + others)), LOG_FLOOR)


@formula
def mean_over_noise(value_x: float, value_y: float, variance_x: float, variance_y: float) -> float:
    """Mean over the axes of a covariance entry over R."""
    return 0.5 * (value_x / variance_x + value_y / variance_y)


@internal
def row_width(hypotheses: int) -> int:
    """Numbers of a row."""
    return BLOCKS * hypotheses + SINGLES


@internal
def write_segment(
    row: NDArray[np.float32], block: Any, lane: int, radii: NDArray[np.float64], setting: Any
) -> None:
    """Write what stays the same over a segment. row: (6 M + 10,); setting: a record `PARAMETERS`."""
    n = radii.size
    M = 2 * n + 1
    for h in range(M):
        row[4 * M + h] = 1.0 if h == block.active_mode[lane] else 0.0
    row[5 * M] = 0.0
    for c in range(n):
        row[5 * M + 1 + c] = 1.0 / radii[c]
        row[5 * M + 1 + n + c] = -1.0 / radii[c]
    singles = row[BLOCKS * M :]
    kept, variance_x, variance_y = block.kept_covariance, setting.variance_x, setting.variance_y
    singles[SPEED] = block.speed[lane]
    singles[ANCHOR_XX] = max(mean_over_noise(kept[0, lane], kept[7, lane], variance_x, variance_y), 0.0)
    singles[ANCHOR_XV] = mean_over_noise(kept[1, lane], kept[8, lane], variance_x, variance_y)
    singles[ANCHOR_VV] = max(mean_over_noise(kept[4, lane], kept[9, lane], variance_x, variance_y), 0.0)
    singles[LOG_NOISE] = setting.log_noise


@internal
def compare_hypotheses(scratch: Any, hypotheses: NDArray[Any], first: int, last: int) -> None:
    """The largest log-likelihood of lanes first .. last - 1, and the log error probability of its mode."""
    for lane in range(first, last):
        scratch.largest[lane] = hypotheses[0].log_likelihood[lane]
        scratch.log_error[lane] = 0.0
        scratch.equals[lane] = -1.0  # the likeliest one itself
    for h in range(1, hypotheses.size):
        kalman = hypotheses[h]
        for lane in range(first, last):
            scratch.largest[lane] = max(scratch.largest[lane], kalman.log_likelihood[lane])
    for h in range(hypotheses.size):
        kalman = hypotheses[h]
        for lane in range(first, last):
            ratio = kalman.log_likelihood[lane] - scratch.largest[lane]
            below = ratio < 0.0  # equals are counted apart: added to 1, small terms would lose their digits
            scratch.log_error[lane] += exp(max(ratio, NEGLIGIBLE)) if below else 0.0
            scratch.equals[lane] += 0.0 if below else 1.0
    for lane in range(first, last):
        scratch.log_error[lane] = log_error_probability(scratch.log_error[lane] + scratch.equals[lane])


@internal
def write_tick(
    row: NDArray[np.float32], block: Any, lane: int, scratch: Any, bank: Any, setting: Any
) -> None:
    """Write what changes with every tick, after `compare_hypotheses`.

    Args:
        row: (6 M + 10,), in which `write_segment` has written the rest.
        setting: a record `PARAMETERS`.
    """
    M = bank.hypotheses.size
    heading_x, heading_y = block.heading[0, lane], block.heading[1, lane]
    for h in range(M):
        kalman, innovation = bank.hypotheses[h], bank.innovations[h]
        along, across = heading_frame(
            clipped_innovation(innovation.white_x[lane]), clipped_innovation(innovation.white_y[lane]),
            heading_x, heading_y,
        )  # fmt: skip
        row[h] = LOG_SCALE * max(kalman.log_likelihood[lane] - scratch.largest[lane], LOG_FLOOR)
        row[M + h] = along
        row[2 * M + h] = across
        # below 0 by rounding only
        row[3 * M + h] = max(innovation.log_variance[lane] - setting.log_noise, 0.0)
    along, across = heading_frame(
        (block.measurement[0, lane] - block.anchor[0, lane]) * setting.noise_whitener,
        (block.measurement[1, lane] - block.anchor[2, lane]) * setting.noise_whitener,
        heading_x, heading_y,
    )  # fmt: skip
    singles = row[BLOCKS * M :]
    singles[TICKS] = TICK_SCALE * block.tick[lane]
    singles[TICKS_LEFT] = TICK_SCALE * (block.length[lane] - block.tick[lane])
    singles[LOG_ERROR] = LOG_SCALE * scratch.log_error[lane]
    singles[ALONG] = LENGTH_SCALE * along
    singles[ACROSS] = LENGTH_SCALE * across
