"""Statistics of scores on curves with known results, their intervals, and the bootstrap over
episodes.
"""

import numpy as np
import pytest
from scipy import stats

from baselines.scoring.estimates import confidence_interval
from baselines.scoring.scores import Scores, at_level, interpolated, mean, quotient

SHARE = mean("right", share=True)
TIME_AT = {level: at_level("right", level, mean("ticks")) for level in (0.4, 0.95, 0.99)}


def scores(right, ticks, episodes=50):
    """Scores with given means; all episodes are equal."""
    values = np.broadcast_to(np.array([right, ticks], float), (episodes, 2, len(right)))
    return Scores("x", "k", tuple(map(float, range(len(right)))), ("right", "ticks"), values)


def test_levels_are_interpolated_linearly():
    line = scores([0.5, 0.9, 1.0], [10, 20, 40])
    falling = at_level("right", 0.8, mean("ticks"), falling=True)
    assert line.estimate(TIME_AT[0.95]).value == pytest.approx(30.0)
    assert line.estimate(TIME_AT[0.4]).value == pytest.approx(10.0)
    assert scores([1.0, 0.9, 0.5], [10, 20, 40]).estimate(falling).value == pytest.approx(25.0)
    for ticks, expected in ((15.0, 0.7), (99.0, 1.0)):
        statistic = interpolated("ticks", ticks, "right")
        assert line.estimate(statistic).value == pytest.approx(expected)


def test_a_level_that_is_not_reached_is_infinite_and_null_in_json():
    line, other = scores([0.5, 0.9], [10, 20]), scores([1.0], [10])
    estimate = line.estimate(TIME_AT[0.99])

    assert np.isinf([estimate.value, estimate.low, estimate.high]).all()
    assert estimate.as_json() == {"value": None, "low": None, "high": None}
    for mine, theirs in ((line, other), (other, line)):
        assert np.isinf(mine.ratio(theirs, TIME_AT[0.99]).value)


def test_ratios_and_differences_are_those_of_the_figures():
    line = scores([0.5, 0.9, 1.0], [10, 20, 40])
    other = scores([0.9, 1.0], [8, 10])

    assert other.ratio(line, TIME_AT[0.95]).value == pytest.approx(9.0 / 30.0)
    assert other.difference(line, SHARE, 0, 2).value == pytest.approx(-0.1)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_the_interval_of_equal_shares_is_wilsons(share):
    expected = stats.binomtest(round(40 * share), 40).proportion_ci(method="wilson")
    estimate = scores([share], [1.0], 40).estimate(SHARE)

    assert (estimate.value, estimate.low, estimate.high) == pytest.approx((share, *expected))


def share_of_sums(means):
    """The quotient of two figures, NaN where the second is 0."""
    return quotient(means[..., 0], means[..., 1])


def test_whole_episodes_are_resampled():
    generator = np.random.default_rng(1)
    counts = generator.integers(1, 9, 200)
    # Sums of delays and numbers of switches, which depend on each other.
    rows = np.stack([generator.gamma(2.0 * counts, 5.0), counts], axis=1)
    shares = [share_of_sums(rows[generator.integers(0, 200, 200)].mean(0)) for _ in range(2000)]
    interval = confidence_interval(rows, of_means=share_of_sums)
    # A bound of 2,000 resamples has a standard deviation of .06 standard errors.
    expected = np.quantile(shares, [0.025, 0.975])
    np.testing.assert_allclose(interval, expected, atol=0.35 * np.std(shares))


def test_resamples_in_which_nothing_is_counted_do_not_count():
    rows = np.full((6, 2), (0.1, 0.0))
    # In one of three resamples this episode is missing.
    rows[0] = 3.0, 1.0
    low, high = confidence_interval(rows, of_means=share_of_sums)

    assert 3.0 < low < 3.5 <= high < 4.0
    rows[:, 1] = 0.0
    assert np.isnan(confidence_interval(rows, of_means=share_of_sums)).all()
    assert confidence_interval(np.array([[3.0, 2.0]]), of_means=share_of_sums) == (1.5, 1.5)
