"""Turn and forecast of the live tracker."""

import numpy as np
import pytest
from recorded_tracks import OBJECTS, follow

from baselines import OnlineTracker, ThresholdDecider
from hybrid_env import QuickestOptions

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
