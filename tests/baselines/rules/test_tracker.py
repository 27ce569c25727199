"""The on-line tracker: times, missing measurements and the first statement."""

import numpy as np
import pytest
from matrix_filters import LiteralImm, MatrixExtendedKalmanFilter
from scipy.special import softmax

from baselines import FixedTimeDecider, OnlineTracker, ThresholdDecider
from hybrid_env import ArgumentError, QuickestOptions, WorldOptions

START = [0.0, 2.0, 0.0, 0.3]
P = np.diag([0.1, 0.04, 0.2, 0.09]) + 0.01 * np.array(
    [[0, 1, 1, 0], [1, 0, 1, 1], [1, 1, 0, 1], [0, 1, 1, 0.0]]
)


def measurements(count, seed=0, scale=0.3):
    generator = np.random.default_rng(seed)
    path = 0.2 * np.arange(1, count + 1)[:, None] * [1.0, 0.1]
    return [tuple(point) for point in (path + generator.normal(0, scale, path.shape)).tolist()]


def assert_same(estimate, other):
    assert (estimate.mode, estimate.decided) == (other.mode, other.decided)
    for mine, theirs in zip(
        estimate[2:],
        other[2:],
        strict=True,
    ):
        np.testing.assert_array_equal(mine, theirs)


def test_missing_measurements_are_predicted_by_the_interacting_multiple_model():
    options = QuickestOptions(
        radii=(2.0, 9.0),
        measurement_variance=(0.1, 0.3),
        hazard=0.1,
    )
    tracker = OnlineTracker(options, ThresholdDecider())
    tracker.begin(START, P)
    curvatures = [0.0, 0.5, 1 / 9, -0.5, -1 / 9]
    literal = LiteralImm(
        START,
        P,
        curvatures,
        options.transition_matrix,
        0.1,
        0.001,
        (0.1, 0.3),
    )
    for k, point in enumerate(measurements(40)):
        missing = k in {6, 10, 11, 12, 20}
        literal.step(None if missing else point)
        # Several are told by the time of the next one.
        if k in {10, 11, 12}:
            continue
        now = tracker.update(None if missing else point, 0.1 * k)
        np.testing.assert_allclose(now.probabilities, literal.probability, rtol=1e-8)
        np.testing.assert_allclose(
            now.estimate,
            literal.estimate,
            rtol=1e-9,
            atol=1e-11,
        )
        np.testing.assert_allclose(
            now.covariance,
            literal.covariance,
            rtol=1e-8,
            atol=1e-10,
        )


@pytest.mark.parametrize("declared", [False, True])
def test_missing_measurements_are_predicted_by_the_filters_of_a_segment(declared):
    tracker = OnlineTracker(
        WorldOptions(bank="anchor_aware"),
        FixedTimeDecider(4 if declared else 1000),
    )
    tracker.begin(START, P, mode=1)
    filters = [
        MatrixExtendedKalmanFilter(
            START,
            P,
            radius,
            0.1,
            0.001,
            (0.1, 0.1),
        )
        for radius in (0.0, 5.0, -5.0)
    ]
    for k, point in enumerate(measurements(25)):
        missing = k in {2, 7, 8, 24}
        for kalman in filters:
            kalman.step(None if missing else point)
        now = tracker.update(None if missing else point)
        # At tick 4, also after missing ones.
        assert now.decided == (declared and k >= 3)
        kalman = filters[now.mode]
        np.testing.assert_allclose(
            now.estimate,
            kalman.s[:4],
            rtol=1e-6,
            atol=1e-8,
        )
        np.testing.assert_allclose(
            now.covariance,
            kalman.P[:4, :4],
            rtol=1e-5,
            atol=1e-8,
        )
        if k <= 3 or not declared:
            expected = softmax([kalman.log_likelihood for kalman in filters])
        np.testing.assert_allclose(now.probabilities, expected, rtol=1e-5)


def test_times_may_deviate_by_the_tolerance_and_give_the_same_as_ticks():
    timed, other = (
        OnlineTracker(
            QuickestOptions(),
            ThresholdDecider(),
            tolerance=0.2,
        )
        for _ in range(2)
    )
    generator = np.random.default_rng(0)
    for k, point in enumerate(measurements(40)):
        time = 10.0 + 0.1 * (k + generator.uniform(-0.09, 0.09))
        assert_same(timed.update(point, time), other.update(point))


def test_a_time_that_is_not_a_tick_later_is_refused_and_changes_nothing():
    tracker, other = (OnlineTracker(QuickestOptions(), ThresholdDecider(0.6)) for _ in range(2))
    for k, point in enumerate(measurements(20)):
        tracker.update(point, 0.1 * k - 0.9)
        other.update(point)
    with pytest.raises(ArgumentError, match=r"time=1\.25 "):
        tracker.update((0.0, 0.0), 1.25)
    assert_same(tracker.update((4.0, 0.4), 1.1), other.update((4.0, 0.4)))


@pytest.mark.parametrize("threshold", [0.8, 1.0])
def test_a_statement_is_decided_from_the_first_crossing_of_the_threshold_on(threshold):
    tracker = OnlineTracker(
        QuickestOptions(measurement_variance=0.01),
        ThresholdDecider(threshold),
    )
    tracker.begin(START, P)
    updates = [tracker.update(point) for point in measurements(60, scale=0.1)]
    decided = [now.decided for now in updates]
    crossed = [now.probabilities.max() >= threshold for now in updates]

    np.testing.assert_array_equal(decided, np.logical_or.accumulate(crossed))
    assert any(decided) == (threshold < 1.0)
    assert not decided[0]
