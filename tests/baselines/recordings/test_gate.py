"""A live track after errors of the sensor and after true jumps, at the scales of several
objects.
"""

import numpy as np
import pytest
from recorded_tracks import directions

from baselines import OnlineTracker, ThresholdDecider
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestOptions

SCALES = {
    "default": {},
    "ship": {"speed": 8.0, "tau": 10.0, "radii": (500.0,), "measurement_variance": 400.0},
    "aircraft": {
        "speed": 230.0,
        "tau": 4.0,
        "radii": (5000.0, 1e4),
        "process_variance": 1.0,
        "measurement_variance": 2500.0,
    },
}
DISTURBED = 60


def measured(options):
    """Measurements of an episode, (T, 2)."""
    env = HybridTrackQuickestVectorEnv(1, **vars(options))
    env.reset(seed=3)
    points = []
    for _ in range(options.ticks):
        points.append(env.world.field("measurement")[0])
        env.step([0])
    return np.array(points)


@pytest.mark.parametrize(
    ("scale", "count", "size"),
    [("default", 1, 30.0), ("ship", 10, 2e7), ("aircraft", 140, 30.0)],
    ids=["one", "ten", "jump"],
)
def test_a_track_is_found_again_within_50_ticks(scale, count, size):
    options = QuickestOptions(ticks=200, **SCALES[scale])
    deviation = np.sqrt(options.variances[0])
    points = measured(options)
    errors = np.zeros_like(points)
    angles = np.full(count, 0.7) if count == 140 else np.arange(count)
    errors[DISTURBED : DISTURBED + count] = size * deviation * directions(angles)
    with_errors, expected = (
        [tracker.update(point) for point in rows]
        for tracker, rows in (
            (OnlineTracker(options, ThresholdDecider(0.6)), points + errors),
            (OnlineTracker(options, ThresholdDecider(0.6)), points),
        )
    )
    # After a jump, errors stay.
    end = DISTURBED + count % 140

    assert with_errors[DISTURBED].status == "far"
    again = end + OnlineTracker.patience + 1
    good = with_errors[:DISTURBED] + with_errors[again:] + expected
    assert {now.status for now in good} == {"begun", "used"}
    pairs = zip(with_errors, expected, strict=True)
    moved = np.array([estimate.estimate[::2] - other.estimate[::2] for estimate, other in pairs])
    if count == 140:
        moved -= errors
    assert np.hypot(*moved.T)[end + 50 :].max() < 3.0 * deviation
