"""A wind or a current in which an object circles."""

import numpy as np
import pytest
from recorded_tracks import directions, follow

from agents import track_recording
from baselines import OnlineTracker
from baselines.recordings.wind import find_wind

WIND = np.array([3.0, -1.5])


def circling(seed, wind=WIND, noise=0.5):
    """Times, positions and modes of an object that flies at 10 m/s, with circles of 15 deg/s."""
    rng = np.random.default_rng(seed)
    modes = np.repeat([0, 1, 0, 2, 0, 1], [60, 120, 60, 120, 60, 120])
    rates = np.radians(15.0) * np.array([0.0, 1.0, -1.0])[modes]
    headings = np.cumsum(rates) - 0.5 * rates
    air = 10.0 * directions(headings)
    # Exact steps of a circle in a second.
    positions = np.cumsum(air * np.sinc(rates / (2.0 * np.pi))[:, None] + wind, axis=0)
    return np.arange(len(modes), dtype=float), positions + rng.normal(0.0, noise, positions.shape)


@pytest.mark.parametrize(("wind", "found"), [(WIND, WIND), ((0.0, 0.0), (0.0, 0.0))])
def test_circles_that_drift_say_the_wind_and_others_say_none(wind, found):
    times, positions = circling(1, np.array(wind))
    circles = [(60, 180, True), (240, 360, False), (420, 540, True)]
    pieces = [(times[a:b], positions[a:b], left) for a, b, left in circles]
    # A drift over 24 s with an error of .5 m has a deviation of .014 m/s; here are 15 windows.
    assert find_wind(pieces) == pytest.approx(found, abs=0.02)


@pytest.mark.parametrize("live", [False, True])
def test_a_recording_in_a_wind_is_tracked_as_one_without(live):
    times, drifting = circling(2)
    _, still = circling(2, np.zeros(2))
    there = track_recording(times + 1e4, drifting, live=live)
    here = track_recording(times, still, live=live)
    assert there.wind == pytest.approx(WIND, abs=0.02)
    assert not here.wind.any()
    assert (there.modes == here.modes).mean() > 0.995
    ground = here.estimates.copy()
    ground[:, ::2] += WIND * (times + 1.0)[:, None]
    ground[:, 1::2] += WIND
    seen = np.isfinite(ground).all(1) & np.isfinite(there.estimates).all(1)
    errors = np.abs(there.estimates - ground)[seen]
    assert np.median(errors, axis=0) == pytest.approx(0.0, abs=0.1)
    assert there.model.radii == pytest.approx([10.0 / np.radians(15.0)], rel=0.02)


def test_a_live_tracker_moves_with_the_wind_of_a_recording():
    times, positions = circling(3)
    recording = track_recording(times, positions, live=True)
    tracker = OnlineTracker.from_recording(recording)
    known = follow(tracker, times, positions)
    assert [each.mode for each in known[10:]] == recording.modes[10:].tolist()
    estimates = np.array([each.estimate for each in known])
    assert estimates[10:] == pytest.approx(recording.estimates[10:], abs=1e-6)
    ahead, _ = tracker.forecast([0.0, 2.0])
    last = estimates[-1]
    assert ahead[0] == pytest.approx(last[::2], abs=0.5)
    assert np.linalg.norm(ahead[1] - ahead[0]) < 2.0 * (10.0 + np.linalg.norm(WIND)) + 1.0
