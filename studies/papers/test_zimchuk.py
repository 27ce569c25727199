"""The reproduction of Zimchuk & Kankin: the pattern of their table, and the corrected filter."""

import numpy as np
import pytest

from baselines import AdaptiveFilter, GHFilter, run_filter
from studies.papers import zimchuk

# 300 coordinates: standard errors of an RMSE are about 1 to 2 % of it.
RUNS = 100


@pytest.fixture(scope="module")
def result():
    return zimchuk.reproduce(runs=RUNS, seed=0)


def row(result, name):
    return np.array([cell.ours for cell in result.cells if cell.row == name])


def test_the_adaptive_filter_follows_manoeuvres_better_than_a_slow_kalman_filter(result):
    adaptive = row(result, "adaptive, as published")
    slow = row(result, "Kalman, sigma_w = 4.64")

    assert (adaptive[[1, 3]] <= 0.4 * slow[[1, 3]]).all()
    assert (adaptive[[0, 2]] <= 4.2).all()
    assert adaptive.shape == slow.shape == (4,)
    inside = [cell.verdict for cell in result.cells if cell.row == "adaptive, as published"]
    assert inside == ["inside"] * 4
    counts = result.count()[zimchuk.TABLE]
    assert counts["sigma_w was fitted to it"] == (1, 1)
    assert counts[""][1] == 7


def test_the_corrected_filter_is_better_on_every_leg(result):
    corrected = row(result, "adaptive, corrected")
    assert (corrected[[0, 2]] <= 2.6).all()
    assert (corrected[[1, 3]] <= 3.6).all()
    assert (corrected < row(result, "adaptive, as published")).all()


def test_noise_of_the_published_filter_is_biased_as_in_a_simulation():
    rng = np.random.default_rng(6)
    for gain, expected in ((0.1, 1.11), (0.2, 1.25)):
        assert zimchuk.noise_bias(gain) == pytest.approx(expected, abs=0.005)
        tracks = 400
        ticks = 500
        z = rng.normal(size=(ticks, tracks, 1))
        states = run_filter(
            GHFilter(1, gain, gain**2 / (2.0 - gain)),
            z,
            np.arange(float(ticks)),
        ).states
        predicted = states[:-1].sum(-1)
        innovation = z[1:, :, 0] - predicted
        difference = z[3:] - 3.0 * z[2:-1] + 3.0 * z[1:-2] - z[:-3]
        products_of = (difference[..., 0] * innovation[2:])[100:]
        error = products_of.mean(0).std() / np.sqrt(tracks)
        assert abs(products_of.mean() - zimchuk.noise_bias(gain)) < 4.0 * error


def test_one_axis_in_matrix_form_is_filtered_as_by_the_axis_wise_filter():
    flights = zimchuk.simulate_flights(20, 0)
    measured = flights.measurements[..., :1]
    alone = run_filter(AdaptiveFilter(1, zimchuk.TAU), measured, flights.times).positions

    np.testing.assert_allclose(
        zimchuk.matrix_positions(measured, 1),
        alone,
        rtol=1e-7,
    )


def test_exact_covariances_of_a_kalman_filter_give_its_gain():
    random = np.random.default_rng(0)
    factor = random.normal(size=(4, 4))
    noise = random.normal(size=(6, 6))
    P = factor @ factor.T
    R = 20.0 * noise @ noise.T + np.eye(6)
    # Three sensors, [x, vx, y, vy].
    C = np.kron(np.tile(np.eye(2), (3, 1)), [[1.0, 0.0]])
    H = C @ P @ C.T + R
    spread = (P @ C.T).reshape(2, 2, 6).swapaxes(0, 1)
    kalman = P @ C.T @ np.linalg.inv(H)
    limited = zimchuk.matrix_gain(H, spread)
    # Within the limits.
    np.testing.assert_allclose(
        limited[0],
        kalman[::2],
        atol=1e-12,
    )
    common = limited[0] @ C[:, ::2]
    assert (np.linalg.eigvals(common).real <= 1.0).all()


def test_correlated_errors_and_unequal_sensors_are_used():
    cells = {(cell.row, cell.column): cell for cell in zimchuk.matrix_ratios(60, 0)}
    for name in ("correlation of x and y -0.9", "two sensors, R = 25 and 100"):
        for leg in ("20-30 s", "30-50 s", "50-70 s"):
            assert cells[name, leg].own_high < 0.9

    assert 0.9 < cells["independent errors", "0-20 s"].ours < 1.15
