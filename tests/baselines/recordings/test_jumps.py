"""Recordings with errors of the sensor and true jumps: fit and decisions are those without them."""

import numpy as np
import pytest
from recorded_tracks import directions

from agents import track_recording
from hybrid_env.simulation import simulate

FIRST = 250


@pytest.fixture(scope="module")
def points():
    return simulate("S100 L100r5 S100 R100r5 S100", 1, 0).measurements[0]


@pytest.fixture(scope="module")
def undisturbed(points):
    return track_recording(None, points)


@pytest.mark.parametrize(
    ("count", "places", "size", "scale"),
    [(1, 1, 30.0, 1.0), (10, 10, 6e6, 1e-3), (500, 1, 30.0, 1.0)],
)
def test_errors_and_jumps_spoil_neither_the_fit_nor_later_decisions(
    points, undisturbed, count, places, size, scale
):
    angles = np.resize(np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, places), count)
    errors = np.zeros_like(points)
    rows = errors[FIRST : FIRST + count]
    rows[:] = size * directions(angles)[: len(rows)]
    tracked = track_recording(None, scale * (points + errors))

    assert tracked.outliers == count % 500
    variance = tracked.model.measurement_variance / scale**2
    assert variance == pytest.approx(undisturbed.model.measurement_variance, rel=0.1)
    moved = errors if count == 500 else 0.0
    apart = tracked.estimates[:, ::2] / scale - moved - undisturbed.estimates[:, ::2]
    assert np.nanmax(np.hypot(*apart.T)[FIRST + 60 :]) < 0.5
    assert (tracked.modes == undisturbed.modes)[FIRST + 60 :].mean() > 0.95
