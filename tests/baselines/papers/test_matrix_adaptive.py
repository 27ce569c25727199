"""The adaptive filter in matrix form: equal to the axis-wise one where matrices are diagonal."""

import numpy as np
import pytest
from hostile_input import refused

from baselines.estimation.run_filter import run_filter
from baselines.papers import zimchuk
from baselines.papers.adaptive import AdaptiveFilter, published_gain
from baselines.papers.matrix_adaptive import MatrixAdaptiveFilter, matrix_gain

TAU = zimchuk.TAU


@pytest.fixture(scope="module")
def flights():
    return zimchuk.simulate_flights(20, 0)


def test_one_axis_is_filtered_as_by_the_axis_wise_filter(flights):
    measured = flights.measurements[..., :1].copy()
    measured[100:110, 3] = np.nan
    alone, matrix = (
        run_filter(kind(1, TAU), measured, flights.times).states for kind in (AdaptiveFilter, MatrixAdaptiveFilter)
    )
    np.testing.assert_allclose(matrix, alone, rtol=1e-7)


def test_diagonal_matrices_have_the_gains_of_the_axes():
    random = np.random.default_rng(3)
    means = random.normal(0.0, 2.0, (8, 500, 2))
    means[0] = random.uniform(5.0, 30.0, (500, 2))
    zero, h1, h2, h3, h4, position, velocity, _ = means
    means[7] = zero - 3.0 * (h1 - h2) - h3  # D^3 nu nu belongs to the lags
    spread = np.stack([3.0 * (h1 - h2) + h3 - position, (3.0 * h1 - 6.0 * h2 + 4.0 * h3 - h4) / TAU - velocity])
    first, second = published_gain(means, TAU)
    first = np.clip(first, 0.0, 1.0)
    second = np.clip(second, 0.0, first**2 / ((2.0 - first) * TAU))
    eye = np.eye(2)
    gains = matrix_gain(zero[..., None] * eye, spread[..., None] * eye, TAU)
    np.testing.assert_allclose(gains, np.stack([first, second])[..., None] * eye, atol=1e-9)


def test_exact_covariances_of_a_kalman_filter_give_its_gain():
    random = np.random.default_rng(0)
    factor, noise = random.normal(size=(4, 4)), random.normal(size=(6, 6))
    P, R = factor @ factor.T, 20.0 * noise @ noise.T + np.eye(6)
    C = np.kron(np.tile(np.eye(2), (3, 1)), [[1.0, 0.0]])  # three sensors, [x, vx, y, vy]
    H = C @ P @ C.T + R
    spread = (P @ C.T).reshape(2, 2, 6).swapaxes(0, 1)
    kalman = P @ C.T @ np.linalg.inv(H)
    limited = matrix_gain(H, spread, 1e-9)
    np.testing.assert_allclose(limited[0], kalman[::2], atol=1e-12)  # within the limits
    common = limited[0] @ C[:, ::2]
    assert (np.linalg.eigvals(common).real <= 1.0).all()


def test_correlated_errors_and_unequal_sensors_are_used():
    cells = {(cell.row, cell.column): cell for cell in zimchuk.matrix_ratios(60, 0)}
    for name in ("correlation of x and y -0.9", "two sensors, R = 25 and 100"):
        for leg in ("20-30 s", "30-50 s", "50-70 s"):
            assert cells[name, leg].own_high < 0.9
    assert 0.9 < cells["independent errors", "0-20 s"].ours < 1.15


def test_bad_arguments_are_refused():
    assert refused(MatrixAdaptiveFilter, 2, TAU, sensors=0).startswith("sensors")
    assert refused(MatrixAdaptiveFilter, 0, TAU).startswith("dimensions")
    several = MatrixAdaptiveFilter(2, TAU, sensors=2)
    assert refused(several.begin_from, state=np.zeros((1, 8))).startswith("state")
    assert refused(run_filter, several, np.zeros((5, 1, 2)), TAU * np.arange(5)).startswith("measurements")
