"""Draws of every law have the distribution of SciPy, and do not depend on how many are drawn at once."""

from collections import namedtuple

import numpy as np
import pytest
from scipy import stats

from hybrid_env.core.compilation import compiled
from hybrid_env.core.noise import LOST, NOISE_ROWS, draw_noise, draw_noise_ahead
from hybrid_env.core.records import LANES
from hybrid_env.noises import OutlierNoise, parse_noise

Setting = namedtuple("Setting", ["noise_law", "noise_shape", "noise_scale", "noise_clip", "missed"])
LAWS = ["gaussian", "outliers 0.3", "levy 1.5 1 44", "levy 1", "levy 0.7 2 1000", "student_t 3"]
draw, draw_ahead = compiled(draw_noise), compiled(draw_noise_ahead)


def setting_of(law, missed=0.0):
    return Setting(*parse_noise(law).parameters, missed)


def seeded(seed):
    return np.random.default_rng(seed).integers(1, 2**64, (4, LANES), dtype=np.uint64)


@compiled
def errors(state, count, setting):
    """Return the rows of `draw_noise`, (count, NOISE_ROWS, LANES)."""
    drawn = np.empty((count, NOISE_ROWS, state.shape[1]))
    for k in range(count):
        draw(state, drawn[k], 0, state.shape[1], setting)
    return drawn


DISTRIBUTIONS = [
    ("gaussian", stats.norm(), 100_000),
    ("levy 2 0.70710678118654752", stats.norm(), 100_000),
    ("levy 1", stats.cauchy(), 100_000),
    ("levy 1.5 2", stats.levy_stable(1.5, 0.0, scale=2.0), 1600),
    ("levy 0.8", stats.levy_stable(0.8, 0.0), 1600),
    ("student_t 3", stats.t(3), 100_000),
    ("student_t 1", stats.cauchy(), 100_000),
]


@pytest.mark.parametrize(
    ("law", "distribution", "count"), DISTRIBUTIONS, ids=[one[0] for one in DISTRIBUTIONS]
)
def test_errors_have_the_distribution_of_their_law(law, distribution, count):
    drawn = errors(seeded(3), count // (2 * LANES), setting_of(law))
    assert stats.kstest(drawn[:, 2:4].ravel(), distribution.cdf).pvalue > 1e-3
    assert stats.kstest(drawn[:, :2].ravel(), "norm").pvalue > 1e-3  # the noise of the velocities is normal


@pytest.mark.parametrize("index", [0.6, 1.0, 1.3, 1.5, 1.9])
def test_stable_errors_have_their_characteristic_function(index):
    drawn = errors(seeded(4), 12_500, setting_of(f"levy {index}"))[:, 2:4].ravel()
    for t in (0.1, 0.5, 1.0, 2.0):  # the standard error of a mean of cosines is below 1 / sqrt(n)
        assert np.cos(t * drawn).mean() == pytest.approx(np.exp(-(t**index)), abs=4.0 / np.sqrt(drawn.size))


def test_the_coordinates_of_a_student_t_error_have_the_bivariate_distribution():
    x, y = errors(seeded(5), 12_500, setting_of("student_t 4"))[:, 2:4].swapaxes(0, 1).reshape(2, -1)
    # (x^2 + y^2) / 2 has the F distribution, and the angle is uniform
    assert stats.kstest((x * x + y * y) / 2, stats.f(2, 4).cdf).pvalue > 1e-3
    assert stats.kstest(np.arctan2(y, x) / (2 * np.pi) + 0.5, "uniform").pvalue > 1e-3


def test_the_coordinates_of_a_stable_error_are_independent():
    x, y = errors(seeded(6), 12_500, setting_of("levy 1.5"))[:, 2:4].swapaxes(0, 1).reshape(2, -1)
    assert abs(stats.spearmanr(x, y).statistic) < 4.0 / np.sqrt(x.size)


def test_errors_are_clipped():
    drawn = np.abs(errors(seeded(7), 1000, setting_of("levy 0.5 1 3"))[:, 2:4])
    assert drawn.max() == 3.0
    assert np.isfinite(errors(seeded(7), 100_000, setting_of("levy 0.5"))[:, :4]).all()
    assert np.abs(errors(seeded(8), 100_000, setting_of("student_t 1"))[:, 2:4]).max() <= 1e6


def test_outliers_have_the_given_share_and_ratio():
    setting = Setting(*OutlierNoise(0.2, 10.0).parameters, 0.0)
    drawn = errors(seeded(9), 12_500, setting)[:, 2:4]
    mixture = lambda x: 0.8 * stats.norm.cdf(x) + 0.2 * stats.norm.cdf(x / 10.0)  # noqa: E731
    assert stats.kstest(drawn.ravel(), mixture).pvalue > 1e-3
    # both coordinates of a measurement are outliers together
    together, expected = (np.abs(drawn) > 9.0).all(1).mean(), 0.2 * (2.0 * stats.norm.sf(0.9)) ** 2
    assert together == pytest.approx(expected, abs=4.0 * np.sqrt(expected / (drawn.size / 2)))


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("missed", [0.0, 0.4])
def test_the_draws_of_a_lane_do_not_depend_on_other_lanes_or_the_number_of_ticks_drawn_at_once(law, missed):
    setting = setting_of(law, missed)
    together, alone, ahead = seeded(9), seeded(9), seeded(9)
    wide, narrow, long = (np.zeros((NOISE_ROWS, LANES)) for _ in range(3))
    rows = [0, 1, 2, 3] + ([LOST] if missed else [])
    largest = 0.0
    for _ in range(50):
        for ticks in range(1, LANES + 1):
            draw_ahead(ahead, 3, long, ticks, setting)
            for tick in range(ticks):
                draw(together, wide, 0, LANES, setting)
                for lane in range(LANES):
                    draw(alone, narrow, lane, lane + 1, setting)
                np.testing.assert_array_equal(wide[rows], narrow[rows])
                np.testing.assert_array_equal(wide[rows, 3], long[rows, tick])
                largest = max(largest, np.abs(wide[:4]).max())
    assert (largest > 8.5) == (law != "gaussian")
