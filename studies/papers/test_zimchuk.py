"""The reproduction of Zimchuk & Kankin: the pattern of their table, and the corrected filter."""

import numpy as np
import pytest

from baselines.estimation.gain_filters import GHFilter
from baselines.estimation.run_filter import run_filter
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
