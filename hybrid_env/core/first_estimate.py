"""The start of an episode: the true initial state, and the first estimate with its error.

The error of the first estimate is drawn from the normal distribution whose covariance the bank may use.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import internal
from hybrid_env.core.noise import draw_normals, uniform


@internal
def draw_first_estimate(block: Any, noise: NDArray[np.float64], lane: int, setting: Any) -> None:
    """Set the initial state of the object of a lane, and draw the first estimate.

    Args:
        block: a record `records.BLOCK`.
        noise: (NOISE_ROWS, LANES), overwritten.
        lane: index of the track in the block.
        setting: a record `PARAMETERS`, or a record with its fields of the first estimate.
    """
    heading = setting.heading
    if math.isnan(heading):
        heading = 2.0 * math.pi * uniform(block.random_state, lane)
    block.truth[0, lane], block.truth[2, lane] = 0.0, 0.0
    block.truth[1, lane] = setting.speed * math.cos(heading)
    block.truth[3, lane] = setting.speed * math.sin(heading)
    draw_normals(block.random_state, noise, np.uint64(lane), np.uint64(lane + 1))
    block.clock[lane] = 0
    block.variance_ratio[lane] = 1.0
    covariance = block.covariance
    for k in range(covariance.shape[0]):
        covariance[k, lane] = 0.0
    for axis in range(2):
        variance = setting.variance_x if axis == 0 else setting.variance_y
        position_variance = setting.initial_position * variance
        velocity_variance = setting.initial_velocity
        position, velocity = noise[2 * axis, lane], noise[2 * axis + 1, lane]
        block.estimate[2 * axis, lane] = block.truth[2 * axis, lane] + math.sqrt(position_variance) * position
        block.estimate[2 * axis + 1, lane] = (
            block.truth[2 * axis + 1, lane] + math.sqrt(velocity_variance) * velocity
        )
        # the variances of the axis in the upper triangle
        covariance[0 if axis == 0 else 7, lane] = position_variance
        covariance[4 if axis == 0 else 9, lane] = velocity_variance
