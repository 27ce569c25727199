"""The computed error of the anchor equals one in matrix form, and that of simulated episodes."""

import numpy as np
import pytest
from matrix_filters import MatrixExtendedKalmanFilter, MatrixKalmanFilter, jacobian
from scipy import linalg
from scipy.stats import chi2

from baselines.rules.anchor_errors import AnchorErrors
from baselines.rules.component_filters import ComponentFilters, speeds, stated_anchors
from baselines.rules.measurements import in_rows, split_sensed
from baselines.rules.propagated import RefilteringDecider
from baselines.rules.rollout import rollout
from hybrid_env import HybridTrackVectorEnv

TICKS = 12
H = np.eye(4)[[0, 2]]


def heading_of(velocity_x, velocity_y):
    turn = np.array([[velocity_x, velocity_y], [-velocity_y, velocity_x]])
    return turn / np.sqrt(velocity_x**2 + velocity_y**2)


def literal_error(kalman, bank, ticks):
    """Return mean (5,) and covariance (5, 5) of error and speed of the anchor after some ticks."""
    R = np.diag(bank.R) if np.ndim(bank.R) == 1 else bank.R
    joint = np.zeros((11, 11))
    joint[:7, :7] = kalman.P
    for _ in range(ticks):
        kalman.x, F, Q = kalman.linearised()
        known, F_bank, Q_bank = bank.linearised()
        P = F_bank @ bank.P @ F_bank.T + Q_bank
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        rest = np.eye(4) - K @ H
        bank.P = rest @ P
        bank.x = rest @ known + K @ kalman.x[[0, 2]]
        A = np.block([[F, np.zeros((7, 4))], [K @ H @ F[:4], rest @ F_bank]])
        # Noise of the velocity moves no position in its tick.
        joint = A @ joint @ A.T + linalg.block_diag(Q, K @ R @ K.T)

    def error(values):
        turn, error = heading_of(values[8], values[10]), values[:4] - values[7:]
        (x, vx), (y, vy) = np.transpose([turn @ error[::2], turn @ error[1::2]])
        return np.array([x, vx, y, vy, np.sqrt(values[8] ** 2 + values[10] ** 2)])

    values = np.concatenate([kalman.x, bank.x])
    J = jacobian(error, values)
    return error(values), J @ joint @ J.T


@pytest.mark.parametrize("declared", [0, 1, 2])
@pytest.mark.parametrize("true_mode", [0, 1, 2])
def test_the_error_equals_the_one_in_matrix_form(declared, true_mode):
    env = HybridTrackVectorEnv(2, scheme="random 2x40-60", tick_info=True)
    rows, _ = env.reset(seed=5)
    world, layout = env.options, env.world.layout
    radii = (0.0, *world.radii, *(-radius for radius in world.radii))
    filters = ComponentFilters("anchor_aware", 1, 2, world)
    errors = AnchorErrors(2, world)
    begins = np.ones(2, np.bool_)
    prior = np.diag([0.04, 0.03, 0.05, 0.02])
    speed = float(speeds(world, rows)[0])
    start = (0.0, speed, 0.0, 0.0)
    model = world.tau, world.process_variance, np.full(2, world.measurement_variance)
    kalman = MatrixExtendedKalmanFilter(start, prior, radii[true_mode], *model)
    bank = MatrixKalmanFilter(start, np.eye(4), radii[declared], *model)
    anchors = stated_anchors(world, rows)
    anchors.covariance[:] = prior
    for _ in range(TICKS):
        filters.advance(rows, begins, anchors, begins)
        errors.advance(rows, begins, None)
        measurement = in_rows(world, rows)[0]
        kalman.step(measurement)
        bank.step(measurement)
        left = int(np.rint(layout.read(rows, "ticks_left")[0]))
        begins = np.zeros(2, np.bool_)
        rows = env.step(np.zeros(2, np.int64))[0]
    mean, covariance = errors.errors_of(
        filters,
        assumption=np.zeros((1, 1), np.int64),
        component=np.zeros((1, 1), np.int64),
        hypothesis=np.full((1, 1), true_mode),
        declared=np.full((1, 1), declared),
        tracks=np.zeros(1, np.int64),
        ticks=np.full((1, 1), left),
    )
    expected_mean, expected = literal_error(kalman, bank, left)
    scale = np.sqrt(np.diag(expected))
    # The rows are float32.
    np.testing.assert_allclose((mean[0, 0] - expected_mean) / scale, 0.0, atol=1e-3)
    np.testing.assert_allclose(
        (covariance[0, 0] - expected) / np.outer(scale, scale), 0.0, atol=1e-3
    )


WORLDS = {
    "R = 0.1": {},
    "R = 0.01": {"measurement_variance": 0.01},
    "unequal axes": {"measurement_variance": (0.025, 0.4)},
    "seven hypotheses": {"radii": (4.0, 8.0, 20.0)},
    "anchor-aware": {"bank": "anchor_aware"},
    "kept covariance": {"reset_covariance": False},
}


def whitened_errors(episodes, alpha=0.003, robust=False, **options):
    """Return the errors of the anchors after right declarations, whitened by their likeliest
    component, (n, 4).
    """
    env = HybridTrackVectorEnv(episodes, trace_rows=101, **options)
    decider = RefilteringDecider(env.options, alpha, robust)
    running = np.ones(episodes, np.bool_)
    whites = []
    truth = np.empty(0)
    for now in rollout(env, decider, 100):
        if now.step:
            running &= ~now.terminated
            decided = np.flatnonzero(running & now.info.get("_decided_mode", False))
            if decided.size:
                modes = now.info["decided_mode"][decided]
                right = modes == now.info["decided_true_mode"][decided]
                rows, _ = split_sensed(decider.layout, now.observation)
                filters, errors = now.state
                _, mean, covariance = errors.after(filters, rows[decided], decided)
                error = anchor_errors(env, decided, truth[decided]) - mean[:, 0]
                root = np.linalg.cholesky(covariance[:, 0])
                whites.append(np.linalg.solve(root, error[..., None])[..., 0][right])
        if not running.any():
            break
        truth = env.world.field("truth").copy()
    return np.concatenate(whites)


def anchor_errors(env, tracks, before):
    """Return (true state - anchor) of tracks that have just been switched, (n, 4), in the heading
    frame; `before` are the true states before the step, (n, 4).
    """
    errors = []
    for track, truth in zip(tracks, before, strict=True):
        # The last row is the first tick of the next segment.
        trace = env.world.read_trace(track)[:-1]
        truth = trace[-1, :4] if len(trace) else truth
        anchor = env.world.field("anchor")[track]
        turn = heading_of(anchor[1], anchor[3])
        position, velocity = ((truth - anchor)[k::2] for k in (0, 1))
        errors.append(np.stack([turn @ position, turn @ velocity], axis=1).ravel())
    return np.reshape(errors, (-1, 4))


def mean_bounds(n):
    """Return bounds of the mean of n squared errors, of a thousandth on each side."""
    return chi2.ppf([0.001, 0.999], 4 * n) / n


QUICK = "R = 0.1", "anchor-aware", "sensors", "robust filters, outliers"


def often(names):
    """Return names of which only a few are quick tests."""
    study = pytest.mark.study
    return [pytest.param(name, marks=[] if name in QUICK else study) for name in names]


@pytest.mark.parametrize("name", often(WORLDS))
def test_errors_of_simulated_episodes_have_the_computed_distribution(name):
    """After right declarations the squared error, whitened by the likeliest component, has a
    chi-square distribution with four degrees of freedom.
    """
    episodes = 150
    white = whitened_errors(episodes, **WORLDS[name])
    square = (white**2).sum(1)
    n = len(square)
    assert n > 4.5 * episodes
    low, high = mean_bounds(n)
    # But for the second order in the heading.
    assert low - 0.1 < square.mean() < high + 0.1
    assert np.all(np.abs(white.mean(0)) < 3.5 / np.sqrt(n) + 0.02)
    inside = np.mean(square < chi2.ppf(0.5, 4))
    assert abs(inside - 0.5) < 3.3 * 0.5 / np.sqrt(n)
