"""The bank of modes of the user with announced switches: one small Kalman filter for every mode,
with all covariances between the states.

Straight motion and turns of a radius have the filter of the anchor-aware bank. A linear mode x' =
F x + B + w has the states [x, vx, y, vy, ax, ay] in the first six places of such a filter. Its
accelerations at the switch are 0, or for a mode with an acceleration along the heading that of the
anchor's heading, whose uncertainty they inherit. With an exact anchor they have no variance.
"""

import math
from typing import Any

from hybrid_env.core.banks.anchor_aware import begin_hypothesis
from hybrid_env.core.banks.anchor_aware import covariance as covariance
from hybrid_env.core.banks.anchor_aware import predicted_position as predicted_position
from hybrid_env.core.banks.anchor_aware import sense as sense
from hybrid_env.core.banks.anchor_aware import step as step
from hybrid_env.core.banks.bank import set_covariance, set_state
from hybrid_env.core.banks.linear import acceleration_covariance, in_seven
from hybrid_env.core.compilation import internal
from hybrid_env.core.memory import DenseBank, FloatArray, State, Triangle4
from hybrid_env.core.motion import heading_vector


@internal
def begin_motion(
    kalman: Any, lane: int, anchor: State, covariance: Triangle4, motion: Any, model: Any
) -> None:
    """Start the filter of a mode; see `anchor_aware.begin_hypothesis`."""
    exact = model.exact_anchor > 0.0
    if not motion.linear:
        radius = motion.signed_radius
        begin_hypothesis(kalman, lane, anchor, covariance, radius, model.tau, exact)
        return
    speed, heading_x, heading_y = heading_vector(anchor[1], anchor[3])
    # Bounded as in `anchor_aware.begin_hypothesis`.
    least = max(speed, math.sqrt(covariance[4] + covariance[9]), 1e-12)
    kalman.log_likelihood[lane] = 0.0
    acceleration = motion.acceleration
    along = acceleration * heading_x, acceleration * heading_y
    set_state(kalman, lane, anchor + along + (0.0,))
    slope = 0.0 if exact else acceleration / least
    spread = acceleration_covariance(covariance, heading_x, heading_y, slope)
    set_covariance(kalman, lane, in_seven(spread))


@internal
def begin(
    bank: DenseBank, lane: int, anchor: State, covariance: Triangle4, radii: FloatArray, model: Any
) -> None:
    """Start every filter of a lane from the anchor; arguments as in `published.begin`."""
    for h in range(bank.hypotheses.size):
        begin_motion(bank.hypotheses[h], lane, anchor, covariance, bank.motions[h], model)
