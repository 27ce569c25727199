"""The state at the begin of a recording with known switches, from all measurements of its first piece.

A published bank takes its first estimate as exact: the centre of a turn follows from it, and an error there
passes on from piece to piece. A straight line through the first measurements is not good enough when the
object turns by much in a tick. So the filters of all modes run backwards over the first piece; their mean,
weighted by the probabilities of the modes, is the first estimate. Measurements of the first piece are thus
used twice, for the start and for the decision.
"""

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.imm_pass import imm_pass, make_chunks, no_output
from hybrid_env.core.compilation import prepare
from hybrid_env.core.imm_bank import ImmModel, imm_arrays
from hybrid_env.model_options import ModelOptions
from hybrid_env.online_worlds import SQUARE

FloatArray = NDArray[np.float64]

MOST_TICKS = 50
FEWEST = 3  # measurements


def first_state(measurements: FloatArray, options: ModelOptions) -> tuple[FloatArray, FloatArray] | None:
    """Return the estimate one tick before the first measurement, and its covariance.

    Args:
        measurements: (T, 2) of the first piece [m], the first one measured, NaN without a measurement.
        options: of the model.

    Returns:
        [x, vx, y, vy] [m, m/s], (4,), and (4, 4); None with too few measurements.
    """
    used = measurements[:MOST_TICKS]
    if (~np.isnan(used[:, 0])).sum() < FEWEST:
        return None
    backwards = np.vstack([used[::-1], np.full((1, 2), np.nan)])  # the last tick only predicts
    chunks = make_chunks([backwards])
    variances = np.broadcast_to(options.variances, 2)
    model = ImmModel(
        options.tau, options.process_variance, float(variances[0]), float(variances[1]), 1.0, 0.0
    )
    radii = np.array(options.radii)
    arguments = chunks, imm_arrays(len(radii)), radii, model, no_output()
    prepare(imm_pass, *arguments)
    imm_pass(*arguments)
    reverse = np.array([1.0, -1.0, 1.0, -1.0])
    estimate = chunks.block["estimate"][0, :, 0] * reverse
    return estimate, chunks.block["covariance"][0, :, 0][SQUARE] * np.outer(reverse, reverse)
