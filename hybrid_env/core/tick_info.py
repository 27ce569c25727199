"""The present tick of every track, copied out of the blocks for `info`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import compiled
from hybrid_env.core.records import LANES

TICK_INTEGERS = ("segment", "tick", "true_mode")
TICK_STATES = ("truth", "anchor", "estimate")


@compiled
def copy_tick(
    blocks: NDArray[Any],
    log_likelihood: NDArray[np.float64],
    integers: NDArray[np.int64],
    states: NDArray[np.float64],
    measurements: NDArray[np.float64],
    log_likelihoods: NDArray[np.float64],
) -> None:
    """Copy the present tick of N tracks in B blocks with M hypotheses.

    Args:
        blocks: (B,) records `records.BLOCK`.
        log_likelihood: (B, M, LANES), cumulative since the switch.
        integers: (3, N), written: `TICK_INTEGERS`.
        states: (3, N, 4), written: `TICK_STATES` [m, m/s].
        measurements: (N, 2), written [m].
        log_likelihoods: (N, M), written.
    """
    for i in range(integers.shape[1]):
        b, lane = i // LANES, i % LANES
        block = blocks[b]
        integers[0, i], integers[1, i] = block.segment[lane], block.tick[lane]
        integers[2, i] = block.true_mode[lane]
        for k in range(4):
            states[0, i, k], states[1, i, k] = block.truth[k, lane], block.anchor[k, lane]
            states[2, i, k] = block.estimate[k, lane]
        measurements[i, 0], measurements[i, 1] = block.measurement[0, lane], block.measurement[1, lane]
        for h in range(log_likelihoods.shape[1]):
            log_likelihoods[i, h] = log_likelihood[b, h, lane]
