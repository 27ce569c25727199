"""The true object: motion with process noise on the velocity, and noisy measurements of the position.

Golubkov 2018, eq. (1).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.motion import heading_vector, motion_coefficients, propagate, turn_centre
from hybrid_env.core.noise import draw_noise
from hybrid_env.core.records import SEGMENT_COLUMNS

SIGNED_RADIUS = SEGMENT_COLUMNS.index("signed_radius")


@internal
def begin_motion(block: Any, lane: int, segment: NDArray[np.float64], tau: float) -> None:
    """Begin a segment of the object of a lane. Centre and turn rate are computed from its true state.

    Args:
        block: a record `records.BLOCK`.
        lane: index of the track in the block.
        segment: a row of the segment table, with columns `records.SEGMENT_COLUMNS`.
        tau: length of a tick [s].
    """
    x, vx, y, vy = block.truth[0, lane], block.truth[1, lane], block.truth[2, lane], block.truth[3, lane]
    signed_radius = segment[SIGNED_RADIUS]  # 0 is straight
    speed, heading_x, heading_y = heading_vector(vx, vy)
    turn_rate = 0.0 if signed_radius == 0.0 else speed / abs(signed_radius)
    cosine, sine_velocity, sine_position = motion_coefficients(turn_rate, tau)
    block.true_motion[0, lane] = cosine
    block.true_motion[1, lane] = sine_velocity
    block.true_motion[2, lane] = sine_position
    centre_x, centre_y = turn_centre(x, y, heading_x, heading_y, signed_radius)
    block.true_centre[0, lane], block.true_centre[1, lane] = centre_x, centre_y


@inlined
def move_lane(block: Any, lane: int, noise: NDArray[np.float64], column: int, setting: Any) -> None:
    """Move the object of one lane by one tick and measure its position.

    Args:
        block: a record `records.BLOCK`.
        lane: index of the track in the block.
        noise: (5, LANES), from `noise.draw_noise`.
        column: column of `noise` for this tick.
        setting: a record with `process_deviation`, sqrt(Q) [m/s], and `deviation_x` and `deviation_y`,
            sqrt(R) [m].
    """
    truth = block.truth
    cosine, sine_velocity, sine_position = (
        block.true_motion[0, lane], block.true_motion[1, lane], block.true_motion[2, lane],
    )  # fmt: skip
    x, vx = propagate(
        truth[0, lane], truth[1, lane], block.true_centre[0, lane], cosine, sine_velocity, sine_position
    )
    y, vy = propagate(
        truth[2, lane], truth[3, lane], block.true_centre[1, lane], cosine, sine_velocity, sine_position
    )
    truth[0, lane] = x
    truth[1, lane] = vx + setting.process_deviation * noise[0, column]
    truth[2, lane] = y
    truth[3, lane] = vy + setting.process_deviation * noise[1, column]
    block.measurement[0, lane] = x + setting.deviation_x * noise[2, column]
    block.measurement[1, lane] = y + setting.deviation_y * noise[3, column]
    block.tick[lane] += 1


@internal
def move(block: Any, noise: NDArray[np.float64], first: int, last: int, setting: Any) -> None:
    """Move the objects of lanes first .. last - 1 by one tick and measure their positions.

    Args:
        block: a record `records.BLOCK`.
        noise: (5, LANES), overwritten.
        first, last: range of lanes.
        setting: see `move_lane`; also `outliers`, the fraction of ticks with outliers.
    """
    draw_noise(block.random_state, noise, first, last, setting.outliers)
    for lane in range(first, last):
        move_lane(block, lane, noise, lane, setting)
