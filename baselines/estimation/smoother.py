"""Fixed-interval smoother. Rauch, Tung & Striebel 1965, "Maximum likelihood estimates of linear
dynamic systems".
"""

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation.kalman import propagate, times_transition
from baselines.estimation.motion_models import MotionModel
from baselines.estimation.run_filter import Estimates, Filtered, check_times
from hybrid_env.checks import FloatArray, reject


def smooth(model: MotionModel, filtered: Filtered, times: ArrayLike) -> Estimates:
    """Return the estimates of a Kalman filter given all measurements, from its output with
    covariances.

    `times`, (T,) or (T, B) [s], are those of the filter. After a robust one the result is
    approximate: the weights of the measurements are those of the filter.
    """
    if filtered.covariances is None:
        raise reject("filtered.covariances", None, "the covariances of a Kalman filter")
    single = filtered.states.ndim == 2
    states = (filtered.states[:, None] if single else filtered.states).copy()
    covariances = (filtered.covariances[:, None] if single else filtered.covariances).copy()
    total, tracks = states.shape[:2]
    steps = np.diff(check_times(times, total, tracks), axis=0)
    for k in range(total - 2, -1, -1):
        begun = ~np.isnan(states[k, :, 0])
        if not begun.any():
            continue
        step = steps[k] if steps.ndim == 1 else steps[k][begun]
        state = states[k, begun]
        covariance = covariances[k, begun]
        transition = model.transition(step)
        noise = model.step_noise(step), np.asarray(model.noise)
        predicted, spread = propagate(state, covariance, transition, *noise)
        gain = _divide(times_transition(covariance, transition), spread)
        states[k, begun] = state + (gain @ (states[k + 1, begun] - predicted)[..., None])[..., 0]
        change = gain @ (covariances[k + 1, begun] - spread) @ gain.swapaxes(1, 2)
        covariances[k, begun] = covariance + 0.5 * (change + change.swapaxes(1, 2))
    if single:
        states = states[:, 0]
        covariances = covariances[:, 0]
    return Estimates(states, covariances, model.order)


def _divide(cross: FloatArray, spread: FloatArray) -> FloatArray:
    """Return cross spread^-1, with the pseudo-inverse where a direction has no variance."""
    deviations = np.sqrt(np.diagonal(spread, axis1=1, axis2=2))
    deviations = np.where(deviations > 0.0, deviations, 1.0)
    scaled = spread / deviations[:, :, None] / deviations[:, None, :]
    right = cross / deviations[:, None, :]
    try:
        np.linalg.cholesky(scaled)
        gain = np.linalg.solve(scaled, right.swapaxes(1, 2)).swapaxes(1, 2)
    except np.linalg.LinAlgError:
        gain = right @ np.linalg.pinv(scaled, hermitian=True)
    return gain / deviations[:, None, :]
