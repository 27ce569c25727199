"""The likelihood of the innovations, against filters in matrix form."""

import math

import numpy as np
import pytest
from matrix_filters import MatrixKalmanFilter

from baselines.recordings.imm_pass import TrackModel, grid_chunks, run_pass
from baselines.recordings.ticks import Piece, TickGrid
from hybrid_env.modes import Straight


def matrix_likelihood(z, v, R, Q, deviation):
    """Log-likelihood of a nearly constant velocity, from the fourth measurement after the start on,
    of positions, and of velocities (n, 2), none for (n, 0).
    """
    first, second = np.flatnonzero(~np.isnan(z[:, 0]))[:2]
    apart = second - first
    vx, vy = (z[second] - z[first]) / apart
    axis = [[R, R / apart], [R / apart, 2 * R / apart**2 + apart * Q]]
    start = [z[second, 0], vx, z[second, 1], vy]
    P = np.kron(np.eye(2), axis)
    kalman = MatrixKalmanFilter(start, P, 0.0, 1.0, Q, R * np.eye(2))
    after = []
    for point, velocity in zip(z[second + 1 :], v[second + 1 :], strict=True):
        told = velocity.size and not np.isnan(velocity).any()
        kalman.rates = [(velocity, None, deviation)] if told else []
        kalman.step(None if np.isnan(point[0]) else point)
        if not np.isnan(point[0]):
            after.append(kalman.log_likelihood)
    return after[-1] - after[2]


@pytest.mark.parametrize("velocities", [0, 2])
@pytest.mark.parametrize("modes", [(), (Straight(),)])
def test_straight_motion_has_the_likelihood_of_a_matrix_filter(modes, velocities):
    rng = np.random.default_rng(0)
    parts = [np.cumsum(rng.normal(1.0, 0.3, (length, 2)), axis=0) for length in (40, 40, 25)]
    for part in parts:
        part[rng.random(len(part)) < 0.3] = np.nan
    # Where there is no position there is no velocity.
    drawn = [rng.normal(1.0, 0.3, (len(part), velocities)) for part in parts]
    rates = [
        np.where(np.isnan(part[:, :1]), np.nan, each)
        for part, each in zip(parts, drawn, strict=True)
    ]
    pieces = tuple(
        Piece(0, len(part), np.arange(len(part)), np.zeros(len(part)), part, measured)
        for part, measured in zip(parts, rates, strict=True)
    )
    chunks, _ = grid_chunks(TickGrid(1.0, pieces, 0, 0.0), 1.0, (), 256)
    model = TrackModel((), 0.5, 0.01, math.inf, 1.0, 1.0, modes=modes, velocity_variance=0.04)
    total = run_pass(chunks, model).log_likelihood
    expected = sum(map(matrix_likelihood, parts, rates, [0.5] * 3, [0.01] * 3, [0.2] * 3))

    assert total == pytest.approx(expected, rel=1e-9)
