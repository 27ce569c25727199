"""Fixed-interval smoother. Rauch, Tung & Striebel 1965, "Maximum likelihood estimates of linear
dynamic systems".
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from studies.arrays import FloatArray
from studies.filters.kalman import propagate
from studies.filters.motion_models import MotionModel
from studies.filters.run_filter import Estimates


def smooth(model: MotionModel, filtered: Estimates, times: ArrayLike) -> Estimates:
    """Return the estimates of a Kalman filter given all measurements, from its output with
    covariances.

    `times`, (T,) or (T, B) [s], are those of the filter. After a robust one the result is
    approximate: the weights of the measurements are those of the filter.
    """
    assert filtered.covariances is not None
    states = filtered.states.copy()
    covariances = filtered.covariances.copy()
    steps = np.diff(np.asarray(times, float), axis=0)
    for k in range(len(steps) - 1, -1, -1):
        begun = ~np.isnan(states[k, ..., 0])
        step = steps[k] if steps.ndim == 1 else steps[k][begun]
        state = states[k][begun]
        covariance = covariances[k][begun]
        predicted, spread = propagate(model, state, covariance, step)
        gain = _divide(covariance @ model.matrices(step)[0].mT, spread)
        change = states[k + 1][begun] - predicted
        states[k][begun] = state + (gain @ change[..., None])[..., 0]
        added = gain @ (covariances[k + 1][begun] - spread) @ gain.mT
        covariances[k][begun] = covariance + 0.5 * (added + added.mT)
    return replace(filtered, states=states, covariances=covariances)


def _divide(cross: FloatArray, spread: FloatArray) -> FloatArray:
    """Return cross spread^-1, with the pseudo-inverse where a direction has no variance."""
    try:
        np.linalg.cholesky(spread)
        return np.asarray(np.linalg.solve(spread, cross.mT).mT)
    except np.linalg.LinAlgError:
        return cross @ np.linalg.pinv(spread, hermitian=True)
