"""The IMM filter between Stone Soup's own hypothesisers, associators, initiators and trackers."""

import datetime

import numpy as np
import pytest

from baselines import OnlineTracker, ThresholdDecider
from baselines.estimation.imm import IMMFilter
from baselines.estimation.kalman import KalmanFilter
from baselines.estimation.motion_models import MotionModel
from hybrid_env import QuickestOptions
from hybrid_env.checks import ArgumentError
from hybrid_env.simulation import simulate

pytest.importorskip("stonesoup")

from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDA
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import SinglePointMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.tracker.simple import MultiTargetMixtureTracker, MultiTargetTracker
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track

from baselines.adapters import IMMPredictor, IMMUpdater, decide_track

START, TICK, VARIANCE = datetime.datetime(2030, 1, 1), 0.1, 0.01
SENSOR = LinearGaussian(4, (0, 2), VARIANCE * np.eye(2))


def moment(tick):
    return START + datetime.timedelta(seconds=TICK * tick)


def adapted(noises=(0.01, 5.0)):
    imm = IMMFilter(
        [KalmanFilter(MotionModel("CV", 2, noise), VARIANCE, (3.0,)) for noise in noises],
        sojourns=3.0,
    )
    return IMMPredictor(imm, measurement_model=SENSOR), IMMUpdater(imm, measurement_model=SENSOR)


def two_targets(ticks=90):
    """True paths (2, T, 2) that cross, and unlabelled detections of each tick."""
    rng = np.random.default_rng(2)
    down = simulate(
        "S30 R40r5 S20",
        start=(0, 2, 4, 0),
        measurement_variance=VARIANCE,
        seed=1,
    )
    up = simulate(
        "S30 L40r5 S20",
        start=(0.5, 2, -4, 0),
        measurement_variance=VARIANCE,
        seed=2,
    )
    scans = []
    for k in range(ticks):
        points = [one.measurements[0, k] for one in (down, up)]
        scans.append(
            (
                moment(k),
                {
                    Detection(point[:, None], timestamp=moment(k))
                    for point in rng.permutation(points)
                },
            )
        )
    return np.stack([down.truth[0][:, ::2], up.truth[0][:, ::2]]), scans


class FirstScan(SinglePointMeasurementInitiator):
    def initiate(self, detections, timestamp, **kwargs):
        return super().initiate(detections, timestamp) if timestamp == START else set()


def tracker_of(kind, scans):
    predictor, updater = adapted()
    initiator = FirstScan(
        GaussianState(
            np.zeros((4, 1)),
            np.diag([0, 9, 0, 9]),
            timestamp=START,
        ),
        SENSOR,
        updater=updater,
    )
    if kind == "GNN":
        hypothesiser = DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=5)
        found = MultiTargetTracker
        association = GNNWith2DAssignment(hypothesiser)
    else:
        hypothesiser = PDAHypothesiser(
            predictor,
            updater,
            clutter_spatial_density=1e-3,
            prob_detect=0.99,
        )
        found = MultiTargetMixtureTracker
        association = JPDA(hypothesiser)
    return found(initiator, UpdateTimeStepsDeleter(5), scans, association, updater)


def test_one_track_is_the_filter_itself_also_in_an_outlier_of_40_deviations():
    predictor, updater = adapted()
    imm = adapted()[0].imm
    start = np.array([0.0, 2.0, 0.0, 0.0]), np.diag([0.1, 1.0, 0.1, 1.0])
    imm.begin_from(start[0][None], start[1])
    track = Track([GaussianState(start[0][:, None], start[1], timestamp=START)])
    for k, measured in enumerate(
        np.random.default_rng(0).normal(0.0, 0.5, (20, 2)),
        1,
    ):
        point = measured + 40.0 * (k == 12)
        prediction = predictor.predict(track, moment(k))
        track.append(
            updater.update(SingleHypothesis(prediction, Detection(point[:, None], moment(k))))
        )
        imm.predict(TICK)
        imm.update(point[None])
        np.testing.assert_allclose(
            np.ravel(track.mean),
            imm.state[0],
            rtol=1e-9,
            atol=1e-9,
        )
        np.testing.assert_allclose(
            track.covar,
            imm.covariance[0],
            rtol=1e-7,
            atol=1e-9,
        )
        np.testing.assert_allclose(
            track[-1].weights.astype(float),
            imm.probabilities[0],
            atol=1e-9,
        )


@pytest.mark.parametrize("kind", ["GNN", "JPDA"])
def test_crossing_targets_keep_their_tracks_and_get_their_modes(kind):
    truth, scans = two_targets()
    *_, (_, tracks) = tracker_of(kind, iter(scans))
    whole = [track for track in tracks if len(track) == len(scans)]

    assert len(whole) == 2
    options = QuickestOptions(radii=(5.0,), tau=TICK, measurement_variance=VARIANCE)
    for track in whole:
        positions = np.array([np.ravel(state.mean)[::2] for state in track])
        errors = np.linalg.norm(positions - truth, axis=-1)
        own = int(errors.mean(1).argmin())
        assert errors[own].max() < 0.5
        stated = decide_track(track, OnlineTracker(options, ThresholdDecider(0.6)))
        modes = np.array([now.mode for now in stated])
        # The one from above turns right.
        assert modes[[25, 60]].tolist() == [0, 2 - own]


def test_a_measurement_model_that_measures_no_positions_is_refused():
    predictor, updater = adapted()
    state = GaussianState(
        np.zeros((4, 1)),
        np.eye(4),
        timestamp=START,
    )
    wrong = LinearGaussian(4, (0, 1), np.eye(2))
    with pytest.raises(ArgumentError, match=r"measurement_model.*mapping \(0, 2\)"):
        updater.predict_measurement(predictor.predict(state, moment(1)), wrong)
