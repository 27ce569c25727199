"""Rows of a recording on uniform ticks."""

import numpy as np
import pytest

from baselines.recordings.clock import TickClock
from baselines.recordings.recording import make_recording
from baselines.recordings.scatter import noise_estimate
from baselines.recordings.ticks import clock_ticks, tick_grid


def circle(times, radius=200.0, speed=20.0):
    angle = speed * times / radius
    return radius * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)


@pytest.mark.parametrize("extra", [0.1, 0.3, 0.6, 0.9])
def test_a_measurement_between_two_ticks_does_not_move_the_clock_for_ever(extra):
    clock = TickClock(0.5)
    times = 0.5 * np.array([0.0, 1.0, 2.0, 2.0 + extra, *range(3, 20)])
    advanced = [clock.advance(time) for time in times]

    assert all(late == 0.0 for _, late in advanced[-10:])
    assert sum(ticks for ticks, _ in advanced) == 20
    # A file has the ticks of a live sensor.
    numbers, late = clock_ticks(times, 0.5)
    assert np.array_equal(np.transpose([np.diff(numbers, prepend=-1), late]), advanced)


def test_noise_is_estimated_also_between_missing_ticks_and_without_units():
    rng = np.random.default_rng(3)
    times = np.arange(2000.0)
    points = circle(times) + rng.normal(0.0, 2.0, (2000, 2))
    points[rng.random(2000) < 0.3] = np.nan
    points[[0, -1]] = 0.0
    grid = tick_grid(make_recording(times, points))
    # Relative standard error 2.4 / sqrt(1400) = 6 %; the turn adds less than 1 %.
    assert noise_estimate(grid) == pytest.approx(4.0, rel=0.2)
    millimetres = tick_grid(make_recording(60.0 * times, 1000.0 * points))
    assert noise_estimate(millimetres) == pytest.approx(1e6 * noise_estimate(grid), rel=1e-9)
