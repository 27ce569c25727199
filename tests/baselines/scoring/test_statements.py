"""Metrics of statements, by hand and against a literal loop."""

import numpy as np
import pytest

from baselines import ThresholdDecider, record_statements
from baselines.scoring.statements import Statements, measure_statements
from hybrid_env import ArgumentError, HybridTrackQuickestVectorEnv


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


def literal_metrics(true, stated):
    """Return (delay, track) of detected switches, sorted, and by track its missed switches and the
    ticks before the new mode is stated.
    """
    found = []
    missed = []
    undetected = []
    for i, (modes, statements) in enumerate(zip(true.T, stated.T, strict=True)):
        starts = [k for k in range(1, len(modes)) if modes[k] != modes[k - 1]]
        missed.append(0)
        undetected.append(0)
        for start, end in zip(starts, [*starts[1:], None], strict=True):
            right = [k for k in range(start, end or len(modes)) if statements[k] == modes[k]]
            if right:
                found.append((right[0] - start, i))
            elif end is not None:
                missed[-1] += 1
            undetected[-1] += (right[0] if right else end or len(modes)) - start
    return sorted(found), missed, undetected


@pytest.mark.parametrize("seed", range(5))
def test_delays_and_misses_equal_those_of_a_literal_loop(seed):
    generator = np.random.default_rng(seed)
    true, stated = (
        np.repeat(
            generator.integers(0, 3, (40, 7)),
            repeats,
            axis=0,
        )[:60]
        for repeats in (5, 2)
    )
    metrics = measure_statements(Statements(true, stated))
    found, missed, undetected = literal_metrics(true, stated)
    pairs = sorted(zip(metrics.delays.tolist(), metrics.delay_tracks.tolist(), strict=True))

    assert pairs == found
    assert metrics.missed.tolist() == missed
    assert metrics.undetected.tolist() == undetected
    assert metrics.value("full_delay") == pytest.approx(sum(undetected) / metrics.switches.sum())
    assert metrics.value("missed") == pytest.approx(sum(missed) / (sum(missed) + len(found)))
    assert sorted(metrics.delays) == sorted(delay for delay, _ in found)


@pytest.mark.parametrize(
    "shapes",
    [
        ((5, 2), (5, 3)),
        ((5,), (5,)),
        ((0, 2), (0, 2)),
    ],
)
def test_other_shapes_are_refused(shapes):
    with pytest.raises(ArgumentError, match="statements"):
        measure_statements(Statements(*(np.zeros(shape, int) for shape in shapes)))


def test_the_reward_is_that_of_the_environment():
    options = {
        "ticks": 120,
        "durations": "uniform 10-30",
        "change_cost": 3.0,
    }
    decider = ThresholdDecider(0.5)
    metrics = measure_statements(record_statements(decider, 30, 8, **options), change_cost=3.0)
    env = HybridTrackQuickestVectorEnv(30, **options)
    rows, _ = env.reset(seed=8)
    total = np.zeros(30)
    for _ in range(120):
        rows, rewards, *_ = env.step(decider.predict(rows)[0])
        total += rewards

    np.testing.assert_allclose(metrics.reward, total / 120, rtol=1e-12)
    assert metrics.wrong_changes.sum() > 0
