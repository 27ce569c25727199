"""
A change detector for skchange
==============================

Thirty lines put ``track_recording``, which segments positions in the plane into straight motion and turns, behind the interface of
`skchange <https://skchange.readthedocs.io>`_ and scikit-learn: ``fit``, ``predict``, ``clone``, ``GridSearchCV``. Here it stands
beside skchange's PELT on the same tracks. ``pip install skchange``
"""

# %%
# Twenty tracks with the same three switches, 0.1 m of noise. PELT looks for changes of the turn rate: it gets the
# turn of the mean velocity of eight ticks, divided by its spread.

import matplotlib.pyplot as plt
import numpy as np
from skchange.detectors import PELT, BaseChangeDetector
from skchange.interval_scorers import L2Cost
from skchange.metrics import changepoint_precision, changepoint_recall
from skchange.utils.validation import check_is_fitted, validate_data

from agents import track_recording
from hybrid_env.rendering.evidence import mode_colour, mode_name
from hybrid_env.simulation import simulate

switches, span = np.array([80, 160, 220]), 8
tracks = simulate("S80 L80r5 S60 R80r5", runs=20, seed=0, measurement_variance=0.01).measurements


class ModeDetector(BaseChangeDetector):
    """Changes between straight motion, left and right turns in the positions of one object.

    Parameters
    ----------
    radii : tuple of float
        Turn radii in the unit of the positions; () finds one to three.
    """

    def __init__(self, radii=()):
        self.radii = radii

    def fit(self, X, y=None):
        """Find noise, radii and mean duration in the positions (T, 2), one at every tick."""
        X = validate_data(self, X, dtype=float, ensure_min_samples=5)
        self.model_ = track_recording(None, X, radii=self.radii).model
        return self

    def predict_modes(self, X):
        """Return the mode at every row, (T,): 0 straight, then left and right turns."""
        check_is_fitted(self)
        found = self.model_
        return track_recording(
            None,
            validate_data(self, X, reset=False, dtype=float, ensure_min_samples=5),
            radii=found.radii,
            measurement_variance=found.measurement_variance,
            process_variance=found.process_variance,
            durations=f"geometric {max(found.duration, 2.0)}",
        ).modes

    def predict(self, X):
        """Return the first rows of new modes, sorted."""
        return np.flatnonzero(np.diff(self.predict_modes(X))) + 1


def turn_rate(track):
    """Turn of the mean velocity of `span` ticks, (T - 2 span, 1), around each tick."""
    steps = track[span:] - track[:-span]
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    turn = heading[span:] - heading[:-span]
    return turn[:, None] / np.median(np.abs(np.diff(turn[::span])))


def pelt(track):
    return PELT(L2Cost(), min_segment_length=20).fit_predict(turn_rate(track)) + span


def modes(track):
    return ModeDetector().fit_predict(track)


for name, detect in {"PELT on turn rates": pelt, "ModeDetector": modes}.items():
    found = [detect(track) for track in tracks]
    precision, recall = (
        np.mean([score(switches, one, tolerance=25) for one in found])
        for score in (changepoint_precision, changepoint_recall)
    )
    print(f"{name:20} precision {precision:.2f}, recall {recall:.2f}, within 25 ticks")

# %%
# Both see the whole track. ``ModeDetector`` also says which mode follows.

track, radii = tracks[1], (5.0,)
detector = ModeDetector(radii=radii).fit(track)
stated, found = detector.predict_modes(track), detector.predict(track)
figure, axes = plt.subplots(figsize=(9, 5), layout="constrained")
for mode in range(3):
    axes.plot(
        *track[stated == mode].T, ".", color=mode_colour(mode, radii), label=mode_name(mode, radii)
    )
axes.plot(*track[switches].T, "ko", markersize=11, fillstyle="none", label="true switches")
axes.plot(*track[found].T, "kx", markersize=9, label="ModeDetector")
axes.plot(*track[pelt(track)].T, "k+", markersize=11, label="PELT on turn rates")
axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
plt.show()
