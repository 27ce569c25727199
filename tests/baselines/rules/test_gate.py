"""A live track after errors of the sensor and after true jumps, at the scales of several
objects.
"""

import numpy as np
import pytest

from baselines import MSPRTDecider, OnlineTracker, ThresholdDecider
from hybrid_env import HybridTrackQuickestEnv, QuickestOptions, WorldOptions

SCALES = {
    "default": {},
    "walker": {
        "speed": 1.4,
        "tau": 1.0,
        "radii": (3.0,),
        "measurement_variance": 9.0,
    },
    "car": {
        "speed": 15.0,
        "radii": (30.0,),
        "process_variance": 0.05,
        "measurement_variance": 1.0,
    },
    "ship": {
        "speed": 8.0,
        "tau": 10.0,
        "radii": (500.0,),
        "measurement_variance": 400.0,
    },
    "aircraft": {
        "speed": 230.0,
        "tau": 4.0,
        "radii": (5000.0, 1e4),
        "process_variance": 1.0,
        "measurement_variance": 2500.0,
    },
}
DISTURBED = 60
ERRORS = {
    "one": 1,
    "ten": 10,
    "ten at one place": 10,
    "jump": 500,
}


def measured(options, seed):
    """Measurements of an episode, (T, 2)."""
    env = HybridTrackQuickestEnv(**vars(options))
    _, info = env.reset(seed=seed)
    points = []
    done = False
    while not done:
        points.append(info["measurement"])
        _, _, done, _, info = env.step(0)
    return np.array(points)


def disturbed(points, kind, size, seed):
    """Return the error of each point, (T, 2)."""
    generator = np.random.default_rng(seed)
    errors = np.zeros_like(points)
    rows = errors[DISTURBED : DISTURBED + ERRORS[kind]]
    angles = generator.uniform(0.0, 2.0 * np.pi, len(rows))
    if kind != "ten":
        angles[:] = angles[0]
    rows[:] = size * np.column_stack([np.cos(angles), np.sin(angles)])
    return errors


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("kind", ERRORS)
@pytest.mark.parametrize("size", [30.0, 2e7])
def test_a_track_is_found_again_within_50_ticks(scale, kind, size):
    options = QuickestOptions(ticks=200, **SCALES[scale])
    deviation = np.sqrt(options.variances[0])
    points = measured(options, 3)
    errors = disturbed(points, kind, size * deviation, 4)
    trackers = [OnlineTracker(options, ThresholdDecider(0.6)) for _ in range(2)]
    with_errors, expected = (
        [tracker.update(z) for z in rows]
        for tracker, rows in zip(
            trackers,
            (points + errors, points),
            strict=True,
        )
    )

    assert not with_errors[DISTURBED].agrees
    assert all(
        now.agrees
        for now in with_errors[:DISTURBED]
        + with_errors[DISTURBED + ERRORS[kind] + OnlineTracker.patience + 1 :]
    )
    pairs = zip(with_errors, expected, strict=True)
    moved = np.array([estimate.estimate[::2] - other.estimate[::2] for estimate, other in pairs])
    if kind == "jump":
        moved -= errors
    distances = np.hypot(*moved.T)[DISTURBED + ERRORS[kind] % 500 + 50 :]
    assert distances.max() < 3.0 * deviation


@pytest.mark.parametrize("kind", ["one", "ten", "jump"])
def test_a_track_with_announced_switches_is_found_again(kind):
    generator = np.random.default_rng(0)
    truth = np.column_stack([0.2 * np.arange(300.0), np.zeros(300)])
    errors = disturbed(truth, kind, 1e5, 4)
    tracker = OnlineTracker(WorldOptions(), MSPRTDecider(0.02))
    for k, point in enumerate(
        truth
        + errors
        + generator.normal(
            0.0,
            np.sqrt(0.1),
            truth.shape,
        )
    ):
        if k in (50, 150):
            tracker.switch(100)
        now = tracker.update(point)
        if k >= DISTURBED + 70:
            assert np.hypot(*(now.estimate[::2] - truth[k] - errors[k])) < 2.0


@pytest.mark.parametrize("scale", SCALES)
def test_no_measurement_of_the_model_is_refused(scale):
    options = QuickestOptions(ticks=400, **SCALES[scale])
    points = measured(options, 5)
    gated, free = (
        OnlineTracker(options, ThresholdDecider(0.6), gate=gate) for gate in (10.0, None)
    )
    for point in points:
        now = gated.update(point)
        expected = free.update(point)
        assert now.agrees
        assert now.mode == expected.mode
        np.testing.assert_array_equal(now.estimate, expected.estimate)
