"""The observation as written by the kernel with unknown switch moments.

`hybrid_env.observation.QuickestLayout` reads it by name. A row is a float32 array of six blocks of M values,
one per hypothesis, followed by two scalars of the track.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import internal
from hybrid_env.core.motion import heading_vector
from hybrid_env.core.observation_row import (
    LARGEST_ANCHOR,
    LOG_FLOOR,
    LOG_SCALE,
    TICK_SCALE,
    innovation_in_frame,
)

QUICKEST_HYPOTHESIS_FEATURES = {
    "log_probability": LOG_SCALE,
    "log_ratio": 1.0,
    "innovation_along": 1.0,
    "innovation_across": 1.0,
    "log_variance": 1.0,
    "stated": 1.0,
}
"""Names of the blocks of M values, in order, and the scale that multiplies each of them."""

QUICKEST_TRACK_FEATURES = {"speed": 1.0, "stated_ticks": TICK_SCALE}
"""Names of the scalars after the blocks, in order, and the scale that multiplies each of them."""

QUICKEST_BLOCKS, QUICKEST_SINGLES = len(QUICKEST_HYPOTHESIS_FEATURES), len(QUICKEST_TRACK_FEATURES)


@internal
def quickest_row_width(hypotheses: int) -> int:
    """Return the number of values of a row."""
    return QUICKEST_BLOCKS * hypotheses + QUICKEST_SINGLES


@internal
def write_quickest_row(row: NDArray[np.float32], block: Any, lane: int, bank: Any, setting: Any) -> None:
    """Write the observation of a track.

    Args:
        row: (6 M + 2,).
        block: a record `QUICKEST_BLOCK`.
        lane: index of the track in the block.
        bank: `imm_bank.ImmBank` of the block.
        setting: a record `QUICKEST_PARAMETERS`.
    """
    M = bank.hypotheses.size
    speed, heading_x, heading_y = heading_vector(block.estimate[1, lane], block.estimate[3, lane])
    largest = bank.hypotheses[0].log_likelihood[lane]
    for h in range(1, M):
        largest = max(largest, bank.hypotheses[h].log_likelihood[lane])
    for h in range(M):
        kalman, innovation = bank.hypotheses[h], bank.innovations[h]
        along, across = innovation_in_frame(innovation, lane, heading_x, heading_y)
        # positive only by rounding
        row[h] = LOG_SCALE * min(max(kalman.log_probability[lane], LOG_FLOOR), 0.0)
        row[M + h] = max(kalman.log_likelihood[lane] - largest, LOG_FLOOR)
        row[2 * M + h] = along
        row[3 * M + h] = across
        row[4 * M + h] = max(innovation.log_variance[lane] - setting.log_noise, 0.0)
        row[5 * M + h] = 1.0 if block.stated_ticks[lane] > 0 and block.stated_mode[lane] == h else 0.0
    row[6 * M] = min(speed, LARGEST_ANCHOR)
    row[6 * M + 1] = TICK_SCALE * block.stated_ticks[lane]
