"""Segmentation of a track in the plane as a change detector of skchange, with the API of
scikit-learn.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skchange.detectors import BaseChangeDetector
from skchange.utils.validation import check_is_fitted, validate_data

from baselines.recordings.decisions import ModelUnits, TickDecisions, decide_recording
from baselines.recordings.model_fit import fit_model
from baselines.recordings.recording import make_recording
from baselines.recordings.ticks import TickGrid, tick_grid
from baselines.rules.decider import Decider
from baselines.rules.threshold import ThresholdDecider
from baselines.rules.tracker import OnlineTracker
from hybrid_env.checks import FloatArray, IntArray
from hybrid_env.durations import GeometricDurations
from hybrid_env.limits import MAX_LENGTH
from hybrid_env.quickest_options import QuickestOptions

# Of the default decider: fewer changes than at its own default.
THRESHOLD = 0.8


class ModeDetector(BaseChangeDetector):
    """Changes between straight motion, left and right turns in the positions of one object.

    `fit` finds noise, radii and durations by maximum likelihood, `model_`; `predict` states a mode
    at every position and returns where it has changed: by hindsight, as the decider states a change
    some rows later.

    Args:
        decider: a decider for unknown switch moments; None is `ThresholdDecider(0.8)`.
        radii: turn radii in the unit of the positions; None finds one to three.
        columns: of x and y among those of the data.

    >>> import numpy as np
    >>> from hybrid_env.simulation import simulate
    >>> track = simulate("S80 L80r5 S80", seed=0, measurement_variance=0.01).measurements[0]
    >>> detector = ModeDetector().fit(track)
    >>> len(detector.predict(track)), np.unique(detector.predict_modes(track)).tolist()
    (2, [0, 1])
    """

    def __init__(
        self,
        decider: Decider | None = None,
        radii: tuple[float, ...] | None = None,
        columns: tuple[int, int] = (0, 1),
    ):
        self.decider, self.radii, self.columns = decider, radii, columns

    def fit(self, X: ArrayLike, y: Any = None) -> "ModeDetector":
        """Find the model of the positions (T, >= 2), one at every tick. y is not used."""
        self.model_ = fit_model(self._grid(X, reset=True), self.radii)
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.int64]:
        """Return the first rows of new modes, sorted. X: (T, >= 2), one row at every tick."""
        return np.flatnonzero(np.diff(self.predict_modes(X))) + 1

    def predict_modes(self, X: ArrayLike) -> NDArray[np.int64]:
        """Return the mode at every row by hindsight, (T,): 0 straight, then the left and the
        right turns.
        """
        check_is_fitted(self)
        grid = self._grid(X, reset=False)
        model = self.model_
        options: dict[str, Any] = ModelUnits.of(model).options(model)
        options |= {
            "durations": GeometricDurations(model.duration),
            "ticks": min(grid.total, MAX_LENGTH),
        }
        world = QuickestOptions(**options, start="random")
        tracker = OnlineTracker(
            world,
            ThresholdDecider(THRESHOLD) if self.decider is None else self.decider,
        )
        return np.concatenate(
            [_moved_back(found, model.duration) for found in decide_recording(grid, model, tracker)]
        )

    def _grid(self, X: ArrayLike, reset: bool) -> TickGrid:
        least = {"ensure_min_samples": 5, "ensure_min_features": 1 + reset}
        rows = validate_data(self, X, reset=reset, dtype=np.float64, **least)
        return tick_grid(make_recording(None, rows[:, list(self.columns)]))


def _moved_back(found: TickDecisions, duration: float) -> IntArray:
    """Return the modes (T,), each change moved back from its decision to the tick from which on the
    new mode is more probable by hindsight, but not beyond the change before. duration: mean of a
    mode [ticks].
    """
    smoothed, modes = _smoothed(found.probabilities, 1.0 / max(duration, 2.0)), found.modes.copy()
    earliest = 0
    for decided in (np.flatnonzero(np.diff(found.modes)) + 1).tolist():
        old = found.modes[decided - 1]
        new = found.modes[decided]
        first = decided
        while first > earliest + 1 and smoothed[first - 1, new] > smoothed[first - 1, old]:
            first -= 1
        modes[first:decided] = new
        earliest = first
    return modes


def _smoothed(filtered: FloatArray, hazard: float) -> FloatArray:
    """Return the probabilities of the modes from all measurements, (T, M), of those from the
    measurements up to each tick; a mode changes in a tick with a probability. Kim 1994, "Dynamic
    linear models with Markov-switching".
    """
    modes = filtered.shape[1]
    transition = np.full((modes, modes), hazard / (modes - 1))
    np.fill_diagonal(transition, 1.0 - hazard)
    smoothed = filtered.copy()
    for k in range(len(filtered) - 2, -1, -1):
        predicted = np.maximum(filtered[k] @ transition, 1e-300)
        smoothed[k] = filtered[k] * (transition @ (smoothed[k + 1] / predicted))
        smoothed[k] /= smoothed[k].sum()
    return smoothed
