"""The bootstrap over episodes, against a literal one and where statistics are undefined."""

import numpy as np

from baselines.scoring.estimates import confidence_interval
from baselines.scoring.scores import quotient


def share_of_sums(means):
    """The quotient of two figures, NaN where the second is 0."""
    return quotient(means[..., 0], means[..., 1])


def delays(seed, episodes=200):
    """Sums of delays and numbers of switches of each episode, which depend on each other."""
    generator = np.random.default_rng(seed)
    counts = generator.integers(1, 9, episodes)
    return np.stack(
        [generator.gamma(2.0 * counts, 5.0), counts],
        axis=1,
    )


def test_whole_episodes_are_resampled():
    rows = delays(1)
    generator = np.random.default_rng(2)
    shares = [share_of_sums(rows[generator.integers(0, 200, 200)].mean(0)) for _ in range(2000)]
    interval = confidence_interval(rows, of_means=share_of_sums)
    # A bound of 2,000 resamples has a standard deviation of .06 standard errors.
    np.testing.assert_allclose(
        interval,
        np.quantile(shares, [0.025, 0.975]),
        atol=0.35 * np.std(shares),
    )


def test_resamples_in_which_nothing_is_counted_do_not_count():
    rows = np.zeros((6, 2))
    # In one of three resamples this episode is missing.
    rows[0] = 3.0, 1.0
    rows[1:, 0] = 0.1
    low, high = confidence_interval(rows, of_means=share_of_sums)

    assert 3.0 < low < 3.5 <= high < 4.0
    rows[:, 1] = 0.0
    assert np.isnan(confidence_interval(rows, of_means=share_of_sums)).all()


def test_a_single_episode_has_no_interval():
    assert confidence_interval(np.array([[3.0, 2.0]]), of_means=share_of_sums) == (1.5, 1.5)
