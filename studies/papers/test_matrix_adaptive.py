"""The adaptive filter in matrix form: equal to the axis-wise one on one axis, and to a Kalman
filter.
"""

import numpy as np
import pytest

from baselines.estimation.gain_filters import AdaptiveFilter
from baselines.estimation.run_filter import run_filter
from studies.papers import zimchuk
from studies.papers.matrix_adaptive import MatrixAdaptiveFilter, matrix_gain

TAU = zimchuk.TAU


@pytest.fixture(scope="module")
def flights():
    return zimchuk.simulate_flights(20, 0)


def test_one_axis_is_filtered_as_by_the_axis_wise_filter(flights):
    measured = flights.measurements[..., :1].copy()
    measured[100:110, 3] = np.nan
    alone, matrix = (
        run_filter(kind(1, TAU), measured, flights.times).states
        for kind in (AdaptiveFilter, MatrixAdaptiveFilter)
    )

    np.testing.assert_allclose(matrix, alone, rtol=1e-7)


def test_exact_covariances_of_a_kalman_filter_give_its_gain():
    random = np.random.default_rng(0)
    factor = random.normal(size=(4, 4))
    noise = random.normal(size=(6, 6))
    P = factor @ factor.T
    R = 20.0 * noise @ noise.T + np.eye(6)
    # Three sensors, [x, vx, y, vy].
    C = np.kron(
        np.tile(np.eye(2), (3, 1)),
        [[1.0, 0.0]],
    )
    H = C @ P @ C.T + R
    spread = (
        (P @ C.T)
        .reshape(2, 2, 6)
        .swapaxes(
            0,
            1,
        )
    )
    kalman = P @ C.T @ np.linalg.inv(H)
    limited = matrix_gain(H, spread, 1e-9)
    # Within the limits.
    np.testing.assert_allclose(limited[0], kalman[::2], atol=1e-12)
    common = limited[0] @ C[:, ::2]
    assert (np.linalg.eigvals(common).real <= 1.0).all()


def test_correlated_errors_and_unequal_sensors_are_used():
    cells = {(cell.row, cell.column): cell for cell in zimchuk.matrix_ratios(60, 0)}
    for name in ("correlation of x and y -0.9", "two sensors, R = 25 and 100"):
        for leg in ("20-30 s", "30-50 s", "50-70 s"):
            assert cells[name, leg].own_high < 0.9

    assert 0.9 < cells["independent errors", "0-20 s"].ours < 1.15
