"""Recordings with errors of the sensor and true jumps: fit and decisions are those without them."""

import numpy as np
import pytest

from agents import track_recording
from hybrid_env import HybridTrackQuickestEnv

FIRST = 200
ERRORS = {
    "one": 1,
    "ten": 10,
    "ten at one place": 10,
    "jump": 500,
}


@pytest.fixture(scope="module")
def points():
    env = HybridTrackQuickestEnv(ticks=500)
    _, info = env.reset(seed=0)
    measured = []
    done = False
    while not done:
        measured.append(info["measurement"])
        _, _, done, _, info = env.step(0)
    return np.array(measured)


@pytest.fixture(scope="module")
def undisturbed(points):
    return track_recording(None, points)


@pytest.mark.parametrize("kind", ERRORS)
@pytest.mark.parametrize(
    ("size", "scale"),
    [(30.0, 1.0), (6e6, 1e-3)],
)
def test_errors_and_jumps_spoil_neither_the_fit_nor_later_decisions(
    points,
    undisturbed,
    kind,
    size,
    scale,
):
    angles = np.random.default_rng(1).uniform(
        0.0,
        2.0 * np.pi,
        ERRORS[kind],
    )
    if kind != "ten":
        angles[:] = angles[0]
    errors = np.zeros_like(points)
    rows = errors[FIRST : FIRST + ERRORS[kind]]
    rows[:] = size * np.column_stack([np.cos(angles), np.sin(angles)])[: len(rows)]
    tracked = track_recording(None, scale * (points + errors))

    assert tracked.outliers == ERRORS[kind] % 500
    assert tracked.model.measurement_variance == pytest.approx(
        scale**2 * undisturbed.model.measurement_variance,
        rel=0.1,
    )
    moved = errors if kind == "jump" else 0.0
    distance = np.hypot(
        *(tracked.estimates[:, ::2] / scale - moved - undisturbed.estimates[:, ::2]).T
    )
    assert np.nanmax(distance[FIRST + 60 :]) < 0.5
    assert (tracked.modes == undisturbed.modes)[FIRST + 60 :].mean() > 0.95


def test_an_object_that_begins_to_move_does_not_jump():
    generator = np.random.default_rng(2)
    path = np.concatenate([np.zeros(300), 2.0 * np.arange(40.0), np.full(300, 78.0)])
    points = np.column_stack([path, np.zeros_like(path)]) + generator.normal(
        0.0,
        0.05,
        (len(path), 2),
    )

    assert track_recording(None, points).outliers <= 2
