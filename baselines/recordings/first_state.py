"""The state at the beginning of a recording, from its first measurements, seen backwards.

A bank for known switches takes its first estimate as exact: the centre of a turn follows from it, and an
error there passes on from piece to piece. A straight line through the first measurements is not good enough
when the object turns by much in a tick. So the interacting multiple model bank runs backwards over the first
ticks; its mean is the first estimate, and its most probable mode the first mode. These measurements are thus
used twice, for the start and for the decisions, which a recording allows and a live sensor does not.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.chunks import recorded_pass
from baselines.recordings.imm_pass import make_chunks
from hybrid_env.core.banks.imm import ImmModel
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.worlds.live import SQUARE

FloatArray = NDArray[np.float64]

MOST_TICKS = 50
FEWEST = 3  # measurements
SURE = 0.6  # probability of a mode that counts as known


class FirstState(NamedTuple):
    """What is known one tick before the first measurement.

    Attributes:
        estimate: (4,) [x, vx, y, vy] [m, m/s].
        covariance: (4, 4).
        mode: None if no mode is probable enough.
    """

    estimate: FloatArray
    covariance: FloatArray
    mode: int | None


def first_state(
    measurements: FloatArray, options: WorldOptions | QuickestOptions, hazard: float
) -> FirstState | None:
    """Return the state one tick before the first measurement; None with too few measurements.

    Args:
        measurements: (T, 2) [m], the first one measured, NaN without a measurement. At most 50 are used.
        options: of the model.
        hazard: probability of a switch in a tick, 0 if there is none in these ticks.
    """
    used = measurements[:MOST_TICKS]
    if (~np.isnan(used[:, 0])).sum() < FEWEST:
        return None
    backwards = np.vstack([used[::-1], np.full((1, 2), np.nan)])  # the last tick only predicts
    chunks = make_chunks([backwards])
    variances = np.broadcast_to(options.variances, 2)
    radii, M = np.array(options.radii), options.hypotheses
    model = ImmModel(
        options.tau, options.process_variance, float(variances[0]), float(variances[1]), 1.0 - hazard,
        hazard / (M - 1),
    )  # fmt: skip
    output = recorded_pass(chunks, radii, model)
    reverse = np.array([1.0, -1.0, 1.0, -1.0])
    covariance = chunks.block["covariance"][0, :, 0][SQUARE] * np.outer(reverse, reverse)
    # a left turn seen backwards is a right turn
    n = len(radii)
    seen = output.probabilities[0, -2, :, 0]
    probabilities = np.concatenate([seen[:1], seen[1 + n :], seen[1 : 1 + n]])
    best = int(probabilities.argmax())
    return FirstState(
        chunks.block["estimate"][0, :, 0] * reverse, covariance, best if probabilities[best] > SURE else None
    )
