"""The on-line tracker: times, missing measurements and the first statement."""

from datetime import date

import numpy as np
import pytest

from baselines import CusumDecider, OnlineTracker, ThresholdDecider
from hybrid_env import QuickestOptions
from hybrid_env.checks import ArgumentError

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
    for mine, theirs in zip(estimate[2:5], other[2:5], strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_a_position_is_used_at_its_time_however_the_clock_jitters():
    tracker = OnlineTracker(QuickestOptions(measurement_variance=1e-4), ThresholdDecider())
    generator = np.random.default_rng(0)
    times = 50.0 + 0.1 * (np.arange(200) + generator.uniform(-0.4, 0.4, 200))
    for time in times:
        now = tracker.update((2.0 * time, -time), time)
        assert now.status == ("used" if time > times[0] else "begun")
    # Without its time, every position would be wrong by up to .08 m.
    np.testing.assert_allclose(now.estimate, [2.0 * time, 2.0, -time, -1.0], atol=1e-3)


@pytest.mark.parametrize("decider", [ThresholdDecider(), CusumDecider()])
def test_late_and_repeated_measurements_give_the_same_as_in_order(decider):
    tracker, other = (OnlineTracker(QuickestOptions(), decider) for _ in range(2))
    points = measurements(120)
    times = [0.1 * k for k in range(120)]
    order = np.arange(120)
    # One comes a tick late, one five, two come together, and one at the beginning.
    for first, last in ((20, 21), (40, 45), (80, 82), (1, 3)):
        order[first : last + 1] = [*range(first + 1, last + 1), first]
    newest = -1
    waiting = set()
    expected = [other.update(points[k], times[k]) for k in range(120)]
    for k in order.tolist():
        now = tracker.update(points[k], times[k])
        assert now.status == ("late" if k < newest else "used" if k else "begun")
        waiting |= set(range(newest + 1, k))
        waiting.discard(k)
        newest = max(newest, k)
        if not waiting:
            assert_same(now, expected[newest])
        again = tracker.update(points[k], times[k])
        assert again.status == "repeated"
        assert_same(again, now)


def test_what_a_sensor_sends_is_never_an_error():
    tracker = OnlineTracker(QuickestOptions(), ThresholdDecider())
    points = measurements(160)
    status = [tracker.update(points[k], 0.1 * k).status for k in range(130)]
    assert status == ["begun"] + ["used"] * 129
    assert tracker.update((np.nan, 1.0), 13.0).status == "missing"
    assert tracker.update((None, None), 13.1).status == "missing"
    assert tracker.update(points[132], np.nan).status == "dropped"
    assert tracker.update(points[132], 13.2).status == "used"
    assert tracker.update(points[5], 0.55).status == "dropped"
    # A stale source sends the last position for as long as it has no other one.
    assert tracker.update(points[132], 13.3).status == "repeated"
    assert tracker.update(points[134], 13.4).status == "used"


@pytest.mark.parametrize("threshold", [0.8, 1.0])
def test_a_statement_is_decided_from_the_first_crossing_of_the_threshold_on(threshold):
    tracker = OnlineTracker(QuickestOptions(measurement_variance=0.01), ThresholdDecider(threshold))
    tracker.begin(START, P)
    updates = [tracker.update(point) for point in measurements(60, scale=0.1)]
    decided = [now.decided for now in updates]
    crossed = [now.probabilities.max() >= threshold for now in updates]

    np.testing.assert_array_equal(decided, np.logical_or.accumulate(crossed))
    assert any(decided) == (threshold < 1.0)
    assert not decided[0]


@pytest.mark.parametrize("time", ["12:00", True, 10**400, date(2024, 5, 1)])
def test_a_time_of_another_form_is_refused_in_one_line(time):
    tracker = OnlineTracker(QuickestOptions(), ThresholdDecider())
    with pytest.raises(ArgumentError, match=r"^time=.*a number.*or a date"):
        tracker.update((0.0, 0.0), time)


def test_a_clock_that_is_set_back_is_told_from_what_is_sent_late():
    points = measurements(240)
    ticks = np.arange(240)

    def statuses(order, times):
        tracker = OnlineTracker(QuickestOptions(), ThresholdDecider())
        return [
            tracker.update(points[k], 0.1 * time).status
            for k, time in zip(order, times, strict=True)
        ]

    # Times of which some have been before, and of which none have.
    for back in (20, 20.5, 60, 1000):
        found = statuses(ticks, ticks - back * (ticks >= 100))
        assert found[104] == "begun"
        assert set(found[105:]) == {"used"}
    # The recording begins anew.
    found = statuses([*ticks, *ticks], [*ticks, *ticks])
    assert found[244] == "begun"
    assert set(found[245:]) == {"used"}
    # What a sensor has kept while it had no connection, and the next measurement.
    order = [*range(60), *range(180, 239), *range(80, 120), 239]
    found = statuses(order, order)
    assert set(found[119:-1]) <= {"late", "dropped"}
    assert found[-1] == "used"


def test_dates_of_any_kind_are_the_same_times():
    points = measurements(20)
    seconds = 1.7e9 + 0.1 * np.arange(20)
    dates = (1e9 * seconds).round().astype("datetime64[ns]")
    kinds = (seconds, dates, [f"{text}Z" for text in dates.astype("datetime64[ms]")])
    results = []
    for times in kinds:
        tracker = OnlineTracker(QuickestOptions(), ThresholdDecider())
        results.append([tracker.update(*row).estimate for row in zip(points, times, strict=True)])
    np.testing.assert_allclose(results[1:], [results[0]] * 2, atol=1e-4)


def test_times_in_another_unit_are_warned_of():
    tracker = OnlineTracker(QuickestOptions(), ThresholdDecider())
    points = measurements(5)
    for k, point in enumerate(points[:-1]):
        tracker.update(point, 100.0 * k)
    with pytest.warns(UserWarning, match="more than 100 ticks apart: are their times in the unit"):
        tracker.update(points[-1], 400.0)
