"""Metrics of statements, by hand and against a literal loop."""

import numpy as np
import pytest

from baselines import ThresholdDecider, record_statements
from baselines.scoring.statements import Statements, measure_statements
from hybrid_env import HybridTrackQuickestVectorEnv


def columns(*texts):
    """Return modes (T, N) from one string of digits for each track."""
    return np.array([[int(mode) for mode in text] for text in texts]).T


def test_metrics_of_two_short_tracks():
    true = columns("0000111222", "2222222200")
    stated = columns("0100011112", "1222222222")
    metrics = measure_statements(Statements(true, stated), change_cost=2.0)

    np.testing.assert_allclose(metrics.right, [0.6, 0.7])
    np.testing.assert_allclose(metrics.wrong_changes, [100.0, 0.0])
    np.testing.assert_allclose(metrics.reward, [(6 - 2) / 10, 0.7])
    assert metrics.stated_changes.tolist() == [4, 1]
    assert metrics.switches.tolist() == [2, 1]
    assert metrics.delays.tolist() == [1, 2]
    assert metrics.delay_tracks.tolist() == [0, 0]
    # The last switch of the second track may still be detected.
    assert metrics.missed.tolist() == [0, 0]
    assert metrics.value("delay") == 1.5
    assert metrics.named_within(3).tolist() == [0, 1, 2, 2, 2]
    assert metrics.value("change_ratio") == pytest.approx(5 / 3)


def test_the_reward_is_that_of_the_environment():
    options = {
        "ticks": 120,
        "durations": "uniform 10-30",
        "change_cost": 3.0,
    }
    decider = ThresholdDecider(0.5)
    metrics = measure_statements(
        record_statements(
            decider,
            30,
            8,
            **options,
        ),
        change_cost=3.0,
    )
    env = HybridTrackQuickestVectorEnv(30, **options)
    rows, _ = env.reset(seed=8)
    total = np.zeros(30)
    for _ in range(120):
        rows, rewards, *_ = env.step(decider.predict(rows)[0])
        total += rewards

    np.testing.assert_allclose(metrics.reward, total / 120, rtol=1e-12)
    assert metrics.wrong_changes.sum() > 0
