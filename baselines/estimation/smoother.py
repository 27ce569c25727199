"""Fixed-interval smoother. Rauch, Tung & Striebel 1965, "Maximum likelihood estimates of linear dynamic systems"."""

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation.kalman import propagate, times_transition
from baselines.estimation.motion_models import MotionModel
from baselines.estimation.run_filter import Estimates, Filtered, check_times
from hybrid_env.checks import BoolArray, FloatArray, reject


def smooth(model: MotionModel, filtered: Filtered, times: ArrayLike) -> Estimates:
    """Return the estimates of a Kalman filter, plain or robust, given all measurements.

    After a robust filter the result is approximate: the weights of the measurements are those of the filter.

    Args:
        model: of the filter.
        filtered: its output, with covariances.
        times: (T,) or (T, B) [s], as given to the filter.

    Raises:
        ArgumentError: the output is of another model or has no covariances, or the times do not fit it.
    """
    if not isinstance(model, MotionModel) or not isinstance(filtered, Filtered):
        raise reject("model", model, "the MotionModel of the filter and its output")
    if filtered.covariances is None:
        raise reject("filtered.covariances", None, "the covariances of a Kalman filter")
    if filtered.states.shape[-1] != model.size or filtered.order != model.order:
        raise reject("model", model.name, f"a model with {filtered.states.shape[-1]} values of the state")
    single = filtered.states.ndim == 2
    states = (filtered.states[:, None] if single else filtered.states).copy()
    covariances = (filtered.covariances[:, None] if single else filtered.covariances).copy()
    total, tracks = states.shape[:2]
    steps = np.diff(check_times(times, total, tracks), axis=0)
    for k in range(total - 2, -1, -1):
        begun = ~np.isnan(states[k, :, 0])
        if begun.any():
            step = steps[k] if steps.ndim == 1 else steps[k][begun]
            _step_back(model, step, states, covariances, k, begun)
    if single:
        states, covariances = states[:, 0], covariances[:, 0]
    return Estimates(states, covariances, model.order)


def _step_back(
    model: MotionModel, step: FloatArray, states: FloatArray, covariances: FloatArray, k: int, chosen: BoolArray
) -> None:
    """Smooth the estimates of tick k of some tracks, in place, by those of tick k + 1."""
    state, covariance = states[k, chosen], covariances[k, chosen]
    transition, noise = model.transition(step), model.step_noise(step)
    predicted, spread = propagate(state, covariance, transition, noise, np.asarray(model.noise))
    gain = _divide(times_transition(covariance, transition), spread)
    states[k, chosen] = state + (gain @ (states[k + 1, chosen] - predicted)[..., None])[..., 0]
    change = gain @ (covariances[k + 1, chosen] - spread) @ gain.swapaxes(1, 2)
    covariances[k, chosen] = covariance + 0.5 * (change + change.swapaxes(1, 2))


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
    return np.asarray(gain / deviations[:, None, :])
