"""What a live tracker says of the measurements some ticks ago."""

import numpy as np
import pytest
import recorded_tracks

from baselines import OnlineTracker, SteadyDecider, smooth_modes
from hybrid_env import QuickestOptions, WorldOptions, simulate
from hybrid_env.checks import ArgumentError

OPTIONS = QuickestOptions(measurement_variance=0.01, durations="geometric 60")
LAG = 10


def seen(scheme="S60 L60r5 S40 R40r5", seed=1, **changed):
    """Measurements (T, 2) and true states (T, 4)."""
    simulated = simulate(scheme, seed=seed, measurement_variance=0.01, **changed)
    return simulated.measurements[0], simulated.truth[0]


def follow(points, times=None, **arguments):
    """What a tracker returns of each measurement, NaN is none."""
    tracker = OnlineTracker(OPTIONS, SteadyDecider(), lag=LAG, **arguments)
    times = 0.1 * np.arange(len(points)) if times is None else times
    return recorded_tracks.follow(tracker, times, points)


def test_probabilities_are_those_of_a_recording_that_ends_now():
    z, _ = seen()
    z[[40, 41, 90]] = np.nan
    known = follow(z, gate=None)
    assert [now.settled for now in known[:LAG]] == [None] * LAG
    for last in (LAG, 45, 70, 128, len(z) - 1):
        ends_now = smooth_modes(z[: last + 1], OPTIONS, branches=32)
        settled = known[last].settled
        row = last - LAG
        np.testing.assert_array_equal(settled.probabilities, ends_now.probabilities[row])
        assert settled.mode == ends_now.modes[row]
        assert settled.time == pytest.approx(0.1 * row)
        deviations = np.sqrt(ends_now.covariances[row].diagonal())
        np.testing.assert_allclose(
            np.abs(settled.estimate - ends_now.estimates[row]) / deviations, 0.0, atol=0.1
        )
        np.testing.assert_allclose(
            np.sqrt(settled.covariance.diagonal()) / deviations, 1.0, atol=0.02
        )


def test_ticks_later_modes_are_right_more_often_and_estimates_nearer():
    right = []
    squares = []
    for seed in range(6):
        z, states = seen(seed=seed)
        modes = np.repeat([0, 1, 0, 2], [60, 60, 40, 40])
        known = follow(z)
        rows = np.arange(len(z) - LAG)
        settled = [known[row + LAG].settled for row in rows]
        of_modes = np.array([[known[row].mode for row in rows], [now.mode for now in settled]])
        right.append((of_modes == modes[rows]).mean(1))
        estimates = np.array(
            [[known[row].estimate for row in rows], [now.estimate for now in settled]]
        )
        squares.append(((estimates - states[rows]) ** 2).mean(1))
    live, later = np.mean(right, axis=0)
    assert later > 0.9 > live + 0.1
    live, later = np.sqrt(np.mean(squares, axis=0))
    assert (later / live < [0.75, 0.5, 0.75, 0.5]).all()


def test_late_measurements_give_the_same():
    z, _ = seen()
    times = 0.1 * np.arange(len(z))
    order = np.arange(len(z))
    order[[71, 72, 73]] = [73, 71, 72]
    expected = follow(z, times)[-1].settled
    late = follow(z[order], times[order])[-1].settled
    np.testing.assert_equal(late, expected)


@pytest.mark.parametrize(
    ("options", "lag", "words"),
    [
        (OPTIONS, 0, "lag=0 is not allowed: expected an integer"),
        (OPTIONS, 2.5, "lag=2.5 is not allowed"),
        (WorldOptions(), 5, "lag=5 is not allowed: expected None with announced switches"),
    ],
)
def test_a_lag_that_is_none_is_refused_in_one_line(options, lag, words):
    with pytest.raises(ArgumentError, match=words):
        OnlineTracker(options, SteadyDecider(), lag=lag)
