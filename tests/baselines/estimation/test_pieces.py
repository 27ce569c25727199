"""Estimates along known modes equal those of all measurements at once, and are calibrated."""

import numpy as np
import pytest

from baselines.estimation.pieces import PIECE_TICKS, PieceSmoother
from hybrid_env import simulate
from hybrid_env.modes import motion_table, parse_modes

TAU = 0.5
Q = 0.02


def at_once(z, R, matrices, start, x0):
    """The mean and covariance of all states by one linear regression, of matrices F and Q of each
    tick.
    """
    ticks = len(z)
    size = 4 * (ticks + 1)
    # States as functions of the start and the noises.
    A = np.zeros((size, size))
    spread = np.zeros((size, size))
    spread[:4, :4] = start
    A[:4, :4] = np.eye(4)
    for k, (F, noise) in enumerate(matrices, start=1):
        A[4 * k : 4 * k + 4] = F @ A[4 * k - 4 : 4 * k]
        A[4 * k : 4 * k + 4, 4 * k : 4 * k + 4] += np.eye(4)
        spread[4 * k : 4 * k + 4, 4 * k : 4 * k + 4] = noise
    prior = A @ spread @ A.T
    mean = A[:, :4] @ x0
    # Columns of z are x, y, vx and vy.
    ticks_seen, columns = np.nonzero(~np.isnan(z))
    H = np.zeros((len(columns), size))
    H[range(len(columns)), 4 * ticks_seen + 4 + np.array([0, 2, 1, 3])[columns]] = 1.0
    noise = R[columns[:, None], columns] * (ticks_seen[:, None] == ticks_seen)
    gain = np.linalg.solve(H @ prior @ H.T + noise, H @ prior).T
    mean = mean + gain @ (z[ticks_seen, columns] - H @ mean)
    P = prior - gain @ H @ prior
    blocks = [slice(4 * k + 4, 4 * k + 8) for k in range(ticks)]
    return np.array([mean[b] for b in blocks]), np.array([P[b, b] for b in blocks])


@pytest.mark.parametrize("coordinates", [2, 4])
def test_straight_motion_and_a_stop_are_one_linear_regression(coordinates):
    modes = parse_modes("straight, stop")
    motions = motion_table(modes, TAU, Q)
    rng = np.random.default_rng(1)
    z = rng.normal(0.0, 1.0, (25, coordinates)).cumsum(0)
    z[[6, 7, 15]] = np.nan
    z[20, 2:] = np.nan
    R = np.diag([0.3, 0.2, 0.4, 0.4])
    R[0, 1] = R[1, 0] = 0.1
    pieces = np.array([[0, 10, 0], [10, 18, 1], [18, 25, 0]])
    root = rng.normal(size=(4, 4))
    start = rng.normal(size=4), root @ root.T
    noises = np.tile([0.3, 0.1, 0.2, 0.4][: coordinates // 2 + 2], (25, 1))
    smoother = PieceSmoother(z, noises, start, motions, TAU, Q, 1.0)
    smoother.settle(pieces)
    estimates, covariances, turns = smoother.smooth()

    straight = np.kron(np.eye(2), [[1.0, TAU], [0.0, 1.0]]), np.diag([0, Q, 0, Q])
    stop = motions[1]["F"][:4, :4], motions[1]["Q"][:4, :4]
    matrices = [straight] * 10 + [stop] * 8 + [straight] * 7
    # What is measured of an object that stands is not the velocity with which it moves on.
    z[10:18, 2:] = np.nan
    mean, P = at_once(z, R, matrices, start[1], start[0])
    np.testing.assert_allclose(estimates, mean, atol=1e-8)
    np.testing.assert_allclose(covariances, P, atol=1e-8)
    assert np.isinf(turns[:10, 2]).all()
    assert np.isnan(turns[10:18, 2]).all()


@pytest.mark.parametrize("freedom", [0.0, 4.0])
def test_estimates_along_turns_are_calibrated(freedom):
    motions = motion_table(parse_modes("straight, left 50, right 50"), 1.0, 0.01)
    pieces = np.array([[0, 60, 1], [60, 100, 0], [100, PIECE_TICKS + 88, 2]])
    squares = []
    for seed in range(4):
        run = simulate(
            f"L60r60 S40 R{PIECE_TICKS - 12}r40",
            seed=seed,
            tau=1.0,
            start=(0.0, 3.0, 0.0, 4.0),
            process_variance=0.01,
            measurement_variance=4.0,
            noise=f"student_t {freedom}" if freedom else "gaussian",
        )
        z = run.measurements[0].copy()
        start = np.array([z[0, 0], 0.0, z[0, 1], 0.0]), np.diag([200.0, 100.0] * 2)
        noises = np.tile([4.0, 0.0, 4.0], (len(z), 1))
        known = start, motions, 1.0, 0.01
        smoother = PieceSmoother(z, noises, *known, speed=5.0, freedom=freedom)
        smoother.settle(pieces)
        estimates, P, turns = smoother.smooth()
        error = estimates - run.truth[0]
        squares.append(np.einsum("ki,kij,kj->k", error, np.linalg.inv(P), error))
        assert np.sqrt((error[:, ::2] ** 2).mean()) < 0.6 * 2.0
        assert abs(turns[30, 2] - 60.0) < 4.0 * turns[30, 3] < 60.0
    # Of four numbers; the errors of neighbours are alike.
    assert 3.0 < np.mean(squares) < 5.0
