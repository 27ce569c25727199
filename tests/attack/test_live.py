"""Live tracks with errors of every kind: estimates stay finite, and the track is found again. What
is no measurement or no time is refused in one line.
"""

import functools
from datetime import UTC, date, datetime

import numpy as np
import pytest
from hostile_input import accepted, counts
from online_episodes import COMMON

from baselines import BeamDecider, CusumDecider, MSPRTDecider, OnlineTracker, ThresholdDecider
from hybrid_env import QuickestOptions, Sensor, WorldOptions, simulate

# After 50 measurements in a row with times of the past a track begins anew.
DISTURBED, STEADY = 40, 70
DECIDERS = {
    "threshold": lambda options: ThresholdDecider(0.6),
    "cusum": lambda options: CusumDecider(3.0),
    "beam": lambda options: BeamDecider(options, branches=5),
    "msprt": lambda options: MSPRTDecider(0.02),
}


@functools.cache
def tracker_of(decider, world):
    options = (WorldOptions if decider == "msprt" else QuickestOptions)(**COMMON[world])
    return OnlineTracker(options, DECIDERS[decider](options))


def follow(seed):
    """Follow an object through 40 ticks with errors of place and clock, and 70 good ones."""
    generator = np.random.default_rng(seed)
    tracker = tracker_of(generator.choice(list(DECIDERS)), generator.choice(list(COMMON)))
    options, announced = tracker.options, tracker.track.announced
    deviation = np.sqrt(options.variances)
    tracker.begin()
    turn = f"L{DISTURBED}r{generator.choice(options.radii):.17g}"
    run = simulate(
        f"{turn} S{STEADY}",
        seed=seed,
        start=(0.0, options.speed, 0.0, 0.0),
        tau=options.tau,
        process_variance=options.process_variance,
        measurement_variance=options.measurement_variance,
    )
    shift, measured, clock = np.zeros(2), False, 0.0
    for k, point in enumerate(run.measurements[0]):
        kinds = ["errors", "jump", "missing", "late", "step", "no time", *[""] * 9]
        kind = generator.choice(kinds) if k < DISTURBED else ""
        if k == DISTURBED and announced:
            tracker.switch()
        size = deviation.max() * 10.0 ** generator.uniform(0.0, 9.0)
        error = generator.normal(0.0, size, 2)
        shift = shift + error * (kind == "jump")
        point = point + shift + error * (kind == "errors")
        clock += options.tau
        if kind == "step":
            clock += options.tau * generator.normal() * 10.0 ** generator.uniform(0.0, 9.0)
        late = options.tau * generator.exponential(20.0) * (kind == "late")
        time = np.nan if kind == "no time" else clock - late
        estimate = tracker.update(None if kind == "missing" else tuple(point.tolist()), time)
        measured |= estimate.status not in ("missing", "dropped")
        assert np.isfinite(estimate.estimate).all() or not measured, (seed, k, kind)
        assert abs(estimate.probabilities.sum() - 1.0) < 1e-6, (seed, k, kind)
        assert (estimate.covariance.diagonal() >= 0.0).all(), (seed, k, kind)
    # A wrong declaration may lead such a track astray, without any error.
    if not announced:
        assert estimate.status == "used", seed
        position = run.truth[0, -1, ::2] + shift
        error = np.hypot(*(estimate.estimate[::2] - position)) / deviation.max()
        assert error < 5.0, (seed, error)


@pytest.mark.parametrize("cases", counts(8, 1_000))
def test_a_live_track_is_found_again(cases):
    for seed in range(cases):
        follow(seed)


TIMES = [None, np.nan, np.inf, -np.inf, 1e308, -1e308, 10**400, True, 1j, "12:00", "1", b"1", [0.0]]
TIMES += [date(2024, 5, 1), datetime.min, datetime(2024, 5, 1, tzinfo=UTC), object()]
TIMES += [np.datetime64("2024-05-01"), np.timedelta64(1, "s"), np.array([1.0, 2.0])]
POINTS = [None, (None, None), (np.nan, 0.0), (np.inf, 1.0), (1e29, -1e29), [0.0, 1.0], np.ones(2)]
POINTS += [
    "ab",
    (1.0, "2"),
    (1j, 2),
    (10**400, 1),
    (1, 2, 3),
    ((1, 2), 3),
    np.ones((2, 2)),
    object(),
]
POINTS += [{}, {"a": 1}, {7: (0.0, 1.0)}, {0: (0.0, 1.0)}, {0: "ab"}, {0: None}, {0: (1, 2, 3)}]
POINTS += [{0: (np.nan, 1.0)}, {0: 10**400}, {1.0: (0.0, 1.0)}]


@functools.cache
def patient_tracker(sensors):
    """A tracker that is asked to predict through gaps of any length."""
    options = QuickestOptions(sensors=(Sensor(variance=0.1),) * sensors)
    return OnlineTracker(options, ThresholdDecider(0.6), gap=1e9)


def disturb(seed):
    """Send a live track what is no measurement or no time, between good ones and long gaps."""
    generator = np.random.default_rng(seed)
    tracker = patient_tracker(int(generator.integers(3)))
    tracker.begin()
    clock = 0.0
    for k in range(30):
        gap = 10.0 ** generator.uniform(0.0, 12.0) if generator.random() < 0.1 else 1.0
        clock += tracker.tau * gap
        time = TIMES[generator.integers(len(TIMES))] if generator.random() < 0.2 else clock
        point = (0.2 * k, float(generator.normal()))
        if generator.random() < 0.2:
            point = POINTS[generator.integers(len(POINTS))]
        estimate = accepted(functools.partial(tracker.update, point, time))
        if estimate is not None:
            assert abs(estimate.probabilities.sum() - 1.0) < 1e-6, (seed, k)
            assert (estimate.covariance.diagonal() >= 0.0).all(), (seed, k)


@pytest.mark.filterwarnings("ignore:the last 5 measurements were more than 100 ticks apart")
@pytest.mark.parametrize("cases", counts(30, 1_000))
def test_a_live_track_takes_or_refuses_whatever_is_sent(cases):
    for sensors in range(3):
        # Its code is compiled.
        patient_tracker(sensors).update((0.0, 0.0))
    for seed in range(cases):
        disturb(seed)
