"""Why KF CV has velocity errors of hundreds of metres per second in the thesis.

Its tuned R is about 1e-9 m^2, where the noise has 156 m^2. With discrete process noise and R / Q towards
0, the gains of position and velocity approach 1 and 2 / t. The estimate then follows every measurement,
and the velocity becomes v' = 2 (z_k - z_{k-1}) / t - v: its error changes sign at every measurement
instead of decaying, and all the noise is summed. The position error, which alone was tuned, hardly shows
it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.estimation.motion_models import MotionModel

FloatArray = NDArray[np.float64]

_STEPS = 10_000  # until the gains are constant


def steady_gains(variance: float, process_variance: float, step: float) -> tuple[float, float]:
    """Constant gains that a CV Kalman filter with discrete process noise reaches.

    Args:
        variance: R of one axis [m^2].
        process_variance: of the acceleration that is constant in a step [m^2/s^4].
        step: time between measurements [s].

    Returns:
        The position gain g and the velocity gain times the step, h, as those of the g-h filter.
    """
    model = MotionModel("CV", axes=1, noise=process_variance, discretization="discrete")
    transition, noise = model.transition(step), process_variance * model.step_noise(step)
    covariance = np.eye(2) * max(variance, 1e-300)
    gain = np.zeros(2)
    for _ in range(_STEPS):
        predicted = transition @ covariance @ transition.T + noise
        last, gain = gain, predicted[:, 0] / (predicted[0, 0] + variance)
        kept = np.eye(2) - np.outer(gain, (1.0, 0.0))
        covariance = kept @ predicted @ kept.T + variance * np.outer(gain, gain)
        if np.allclose(gain, last, rtol=1e-12, atol=0.0):
            break
    return float(gain[0]), float(gain[1] * step)


def without_noise(parameters: dict[str, Any]) -> dict[str, Any]:
    """The parameters of a filter of the thesis, with R a millionth: the limit of gains 1 and 2 / t."""
    return parameters | {"variances": tuple(1e-6 * variance for variance in parameters["variances"])}


def memory(g: float, h: float) -> float:
    """Largest magnitude of an eigenvalue of the error of a g-h filter; at 1 an error never decays."""
    error = np.array([[1.0 - g, 1.0 - g], [-h, 1.0 - h]])  # of position, and velocity times the step
    return float(np.abs(np.linalg.eigvals(error)).max())
