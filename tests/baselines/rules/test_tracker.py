"""The on-line tracker: times, missing measurements, starts, copies and bad input."""

import copy
import pickle
import re

import numpy as np
import pytest
from matrix_filters import LiteralImm, MatrixExtendedKalmanFilter, MatrixKalmanFilter

from baselines import (
    BeamDecider,
    FixedTimeDecider,
    MSPRTDecider,
    OnlineTracker,
    ThresholdDecider,
)
from baselines.rules.refiltering import RefilteringDecider
from hybrid_env import ArgumentError, QuickestOptions, WorldOptions

START = [0.0, 2.0, 0.0, 0.3]
P = np.diag([0.1, 0.04, 0.2, 0.09]) + 0.01 * np.array(
    [[0, 1, 1, 0], [1, 0, 1, 1], [1, 1, 0, 1], [0, 1, 1, 0.0]]
)


def quickest(**options):
    return OnlineTracker(QuickestOptions(**options), ThresholdDecider(0.6))


def announced(decider=None, **options):
    return OnlineTracker(WorldOptions(**options), decider or MSPRTDecider(0.02))


def measurements(count, seed=0, scale=0.3):
    generator = np.random.default_rng(seed)
    path = 0.2 * np.arange(1, count + 1)[:, None] * [1.0, 0.1] + generator.normal(
        0,
        scale,
        (count, 2),
    )
    return [tuple(point) for point in path.tolist()]


def assert_same(estimate, other):
    assert (estimate.mode, estimate.decided) == (other.mode, other.decided)
    for mine, theirs in zip(estimate[2:], other[2:], strict=True):
        np.testing.assert_array_equal(mine, theirs)


@pytest.mark.parametrize("by_time", [True, False])
def test_missing_measurements_are_predicted_by_the_interacting_multiple_model(by_time):
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
    missing = {6, 10, 11, 12, 20, 38, 39}
    for k, point in enumerate(measurements(40)):
        literal.step(None if k in missing else point)
        if k in missing and by_time:
            continue
        now = tracker.update(None if k in missing else point, 0.1 * k)
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
@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
def test_missing_measurements_are_predicted_by_the_filters_of_a_segment(bank, declared):
    tracker = announced(
        FixedTimeDecider(4 if declared else 1000),
        bank=bank,
        reset_covariance=False,
    )
    covariance = np.diag([0.1, 0.04, 0.1, 0.04])
    tracker.begin(START, covariance, mode=1)
    if bank == "published":
        modes = [
            ("S", 0.0),
            ("L", 5.0),
            ("R", 5.0),
        ]
        R = 0.1 * np.eye(2)
        filters = [MatrixKalmanFilter(START, covariance, *mode, 0.1, 0.001, R) for mode in modes]
    else:
        R = (0.1, 0.1)
        filters = [
            MatrixExtendedKalmanFilter(START, covariance, r, 0.1, 0.001, R)
            for r in (0.0, 5.0, -5.0)
        ]
    for k, point in enumerate(measurements(25)):
        missing = k in {2, 7, 8, 24}
        for kalman in filters:
            kalman.step(None if missing else point)
        now = tracker.update(None if missing else point)
        # At tick 4, also after missing ones.
        assert now.decided == (declared and k >= 3)
        kalman = filters[now.mode]
        mean = kalman.x if bank == "published" else kalman.s[:4]
        np.testing.assert_allclose(
            now.estimate,
            mean,
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
            likelihoods = np.array([kalman.log_likelihood for kalman in filters])
        expected = np.exp(likelihoods - likelihoods.max())
        np.testing.assert_allclose(
            now.probabilities,
            expected / expected.sum(),
            rtol=1e-5,
        )


@pytest.mark.parametrize("tau", [1e-6, 0.1, 5.0])
def test_times_may_deviate_by_the_tolerance_and_give_the_same_as_ticks(tau):
    options = QuickestOptions(
        tau=tau,
        speed=0.2 / tau,
        initial_error=(1.0, (0.02 / tau) ** 2),
    )
    timed, other = (
        OnlineTracker(
            options,
            ThresholdDecider(),
            tolerance=0.2,
        )
        for _ in range(2)
    )
    generator = np.random.default_rng(0)
    for k, point in enumerate(measurements(40)):
        time = 100 * tau + tau * (k + generator.uniform(-0.09, 0.09))
        assert_same(timed.update(point, time), other.update(point))


@pytest.mark.parametrize(
    "time",
    [0.95, 1.25, 1e300],
)
def test_a_time_that_is_not_a_tick_later_is_refused_and_changes_nothing(time):
    tracker = quickest()
    other = quickest()
    for k, point in enumerate(measurements(20)):
        tracker.update(point, 0.1 * k - 0.9)
        other.update(point)
    with pytest.raises(ArgumentError, match=re.escape(f"time={time} ")) as caught:
        tracker.update((0.0, 0.0), time)

    assert "\n" not in str(caught.value)
    assert_same(
        tracker.update((4.0, 0.4), 1.1),
        other.update((4.0, 0.4)),
    )


BAD = [
    (1.0, float("nan")),
    (float("inf"), 0.0),
    (1.0, 2.0, 3.0),
    {"x": 1.0},
]


@pytest.mark.parametrize("point", BAD, ids=repr)
def test_a_bad_measurement_is_refused_and_changes_nothing(point):
    tracker = announced()
    other = announced()
    for earlier in measurements(15):
        tracker.update(earlier, None)
        other.update(earlier)
    with pytest.raises(ArgumentError, match="measurement") as caught:
        tracker.update(point, 3.0)

    assert "\n" not in str(caught.value)
    assert_same(tracker.update((3.2, 0.3)), other.update((3.2, 0.3)))


@pytest.mark.parametrize(
    "how",
    [copy.deepcopy, copy.copy, lambda original: pickle.loads(pickle.dumps(original))],
)
@pytest.mark.parametrize("after", [2, 30])
@pytest.mark.parametrize("known", [True, False])
def test_copies_go_on_alike_and_independently(known, after, how):
    if known:
        tracker = announced(RefilteringDecider(WorldOptions(), prior=None))
    else:
        tracker = OnlineTracker(QuickestOptions(), BeamDecider(QuickestOptions(), branches=9))
    points = measurements(60, seed=4)
    for k in range(after):
        tracker.update(points[k], 0.1 * k)
    other = how(tracker)
    for name, array in other.world.arrays().items():
        assert not np.shares_memory(array, tracker.world.arrays()[name])
    updates = [tracker.update(points[k], 0.1 * k) for k in range(after, 60)]
    for k in range(after, 60):
        assert_same(
            other.update(points[k], 0.1 * k),
            updates[k - after],
        )


def decided_from(decider, mode=None, count=60):
    """The first tick with `decided`, from which on it stays, and the largest probabilities of
    all ticks before it.
    """
    tracker = OnlineTracker(QuickestOptions(measurement_variance=0.01), decider)
    tracker.begin(START, P, mode)
    updates = [tracker.update(point) for point in measurements(count, scale=0.1)]
    decided = [now.decided for now in updates]
    first = decided.index(True) if any(decided) else count
    assert all(decided[first:])
    return first, [now.probabilities.max() for now in updates[: first + 1]]


@pytest.mark.parametrize("threshold", [0.4, 0.6, 0.7, 0.8])
@pytest.mark.parametrize("kind", [ThresholdDecider, BeamDecider])
def test_a_first_statement_is_decided_from_the_crossing_of_the_threshold_on(kind, threshold):
    decider = (
        kind(threshold)
        if kind is ThresholdDecider
        else kind(QuickestOptions(measurement_variance=0.01), threshold)
    )
    first, largest = decided_from(decider)
    if kind is ThresholdDecider:
        assert (np.array(largest[:-1]) < threshold).all()
        assert largest[-1] >= threshold

    assert 0 < first < 60


def test_what_is_never_crossed_is_never_decided():
    assert decided_from(ThresholdDecider(1.0))[0] == 60
