"""Turn and forecast of the live tracker."""

import numpy as np
import pytest
from recorded_tracks import OBJECTS, follow

from baselines import OnlineTracker, ThresholdDecider
from hybrid_env import ArgumentError, QuickestOptions

CAR = OBJECTS["car"]
POINTS = CAR.simulate(1, 2, "SLSR", (30, 40, 30, 40)).measurements[0]
TIMES = CAR.times(len(POINTS))


def tracker(**units):
    return OnlineTracker(CAR.options(QuickestOptions), ThresholdDecider(0.6), **units)


def test_turn_and_forecast_are_in_the_units_of_the_measurements():
    # Kilometres and minutes.
    scales, origin = np.array([1e3, 1e3 / 60] * 2), np.array([7.0, 0, -3.0, 0])
    metres, other = tracker(), tracker(scales=scales, origin=origin)
    now = follow(metres, TIMES, POINTS)[-1]
    then = follow(other, TIMES / 60, POINTS / 1e3 + origin[::2])[-1]
    assert now.turn.radius == pytest.approx(CAR.radius, rel=0.1)
    units = [1e3 / 60, 1e3 / 60, 1e3, 1e3]
    np.testing.assert_allclose(np.multiply(then.turn, units), now.turn, rtol=1e-6)
    means, covariances = metres.forecast([1.0, 5.0])
    means_then, covariances_then = other.forecast([1.0 / 60, 5.0 / 60])
    np.testing.assert_allclose((means_then - origin[::2]) * 1e3, means, rtol=1e-6)
    np.testing.assert_allclose(covariances_then * 1e6, covariances, rtol=1e-6)


def test_a_late_measurement_is_filtered_again_by_the_filter_of_the_turn():
    in_time, late = tracker(), tracker()
    order = np.arange(len(POINTS))
    order[[60, 61]] = 61, 60
    now = follow(in_time, TIMES, POINTS)[-1]
    then = follow(late, TIMES[order], POINTS[order])[-1]
    assert now.turn == then.turn
    for mine, theirs in zip(in_time.forecast([2.0]), late.forecast([2.0]), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_before_the_bank_begins_there_is_no_forecast():
    mine = tracker()
    assert np.isnan(follow(mine, TIMES[:2], POINTS[:2])[-1].turn[2:]).all()
    assert np.isnan(mine.forecast([1.0])[0]).all()
    follow(mine, TIMES[2:5], POINTS[2:5])
    assert np.isfinite(mine.forecast([1.0])[0]).all()
    with pytest.raises(ArgumentError, match="seconds"):
        mine.forecast([-1.0])
