"""
Two crossing targets in Stone Soup
==================================

Two targets cross, and nobody says which detection is whose; some are missing, and some are clutter. `Stone Soup
<https://stonesoup.readthedocs.io>`_ associates them, with the interacting multiple model filter of HybridTrack as its
predictor and updater. Each of its tracks then goes through a live tracker, whose decider states mode and switches.
``pip install "hybrid-track[stonesoup]"``
"""

# %%
# The scans: at each tick a set of detections without labels. Halfway the
# targets pass each other at 2 cm, a fifth of the standard deviation of a detection.

import datetime

import matplotlib.pyplot as plt
import numpy as np
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import (
    CombinedLinearGaussianTransitionModel,
    ConstantVelocity,
)
from stonesoup.tracker.simple import MultiTargetTracker
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.types.update import Update

from baselines import IMMPredictor, IMMUpdater, OnlineTracker, ThresholdDecider
from hybrid_env import QuickestOptions
from hybrid_env.rendering.evidence import mode_colour, mode_name
from hybrid_env.simulation import simulate

tau, variance, radii = 0.1, 0.01, (5.0,)
down = simulate(
    "S40 R20r5 S60 L60r5", seed=1, start=(0, 2, 8, 0), tau=tau, measurement_variance=variance
)
up = simulate(
    "S40 L20r5 S60 R60r5", seed=5, start=(-1, 2, -6.6, 0), tau=tau, measurement_variance=variance
)
truth = np.stack([down.truth[0], up.truth[0]])
ticks = truth.shape[1]

rng, start = np.random.default_rng(0), datetime.datetime(2030, 1, 1)
scans = []
for k in range(ticks):
    time = start + datetime.timedelta(seconds=tau * k)
    points = [one.measurements[0, k] for one in (down, up) if rng.random() < 0.95]
    points += list(rng.uniform((0, -10), (26, 10), (rng.poisson(0.5), 2)))
    scans.append((time, {Detection(point[:, None], timestamp=time) for point in points}))

# %%
# Stone Soup's own hypothesiser, associator, initiator and deleter around our predictor and updater. The filter has a
# model for steady motion and one for turns.

sensor = LinearGaussian(4, (0, 2), variance * np.eye(2))
models = [
    CombinedLinearGaussianTransitionModel([ConstantVelocity(noise), ConstantVelocity(noise)])
    for noise in (0.01, 3.0)
]
predictor, updater = IMMPredictor(models, [[0.98, 0.02], [0.02, 0.98]]), IMMUpdater(sensor)
associator = GNNWith2DAssignment(
    DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=4)
)
deleter = UpdateTimeStepsDeleter(10)
initiator = MultiMeasurementInitiator(
    GaussianState(np.zeros((4, 1)), np.diag([0.0, 9.0, 0.0, 9.0]), timestamp=start),
    UpdateTimeStepsDeleter(2), associator, updater, measurement_model=sensor, min_points=8,
)  # fmt: skip
tracks = set()
for _, present in MultiTargetTracker(initiator, deleter, iter(scans), associator, updater):
    tracks |= present
tracks = sorted(tracks, key=len)[-2:]

# %%
# A live tracker for each of them. Both targets switch after 4, 6 and 12 s; the first statements come before anything is known.


def measured_position(state):
    """The position that a state was updated with; None without a detection."""
    return (
        np.ravel(state.hypothesis.measurement.state_vector) if isinstance(state, Update) else None
    )


options, stated = QuickestOptions(radii=radii, tau=tau, measurement_variance=variance), []
for track in tracks:
    tracker = OnlineTracker(options, ThresholdDecider(0.8))
    moments = [(state.timestamp - track[0].timestamp).total_seconds() for state in track]
    stated.append(
        [
            tracker.update(measured_position(state), moment)
            for state, moment in zip(track, moments, strict=True)
        ]
    )

figure, (ground, probability) = plt.subplots(
    2, 1, figsize=(9, 7.5), layout="constrained", height_ratios=(2, 1)
)
clutter = np.array([np.ravel(one.state_vector) for _, scan in scans for one in scan])
ground.plot(*clutter.T, ".", color="0.8", markersize=3, label="detections")
ground.plot(*truth[:, :, [0, 2]].T, color="0.6", linewidth=4, alpha=0.5)
for track, updates, style in zip(tracks, stated, ("-", ":"), strict=True):
    modes, where = (
        np.array([now.mode for now in updates]),
        np.array([now.estimate for now in updates]),
    )
    times = np.array([(state.timestamp - start).total_seconds() for state in track])
    for mode in range(3):
        part = modes == mode
        ground.plot(*where[part][:, [0, 2]].T, ".", color=mode_colour(mode, radii), markersize=5)
        chance = [now.probabilities[mode] for now in updates]
        probability.plot(times, chance, style, color=mode_colour(mode, radii))
    switches = times[np.flatnonzero(np.diff(modes)) + 1]
    missed = sum(measured_position(state) is None for state in track)
    errors = np.linalg.norm(
        where[:, None, [0, 2]] - truth[:, -len(track) :, [0, 2]].swapaxes(0, 1), axis=-1
    )
    own = int(errors.mean(0).argmin())
    print(
        ("from above:", "from below:")[own],
        f"{len(track)} of {ticks} ticks, {missed} without a detection,",
    )
    print(
        f"    never more than {errors[:, own].max():.2f} m from its target, switches stated at",
        switches,
        "s",
    )
for mode in range(3):
    ground.plot([], [], "o", color=mode_colour(mode, radii), label=mode_name(mode, radii))
ground.set(xlabel="x, m", ylabel="y, m", aspect="equal", title="Stated modes of both tracks")
ground.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
probability.set(
    xlabel="time, s", ylabel="probability", title="Modes of both tracks, solid and dotted"
)
plt.show()
