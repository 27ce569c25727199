"""Counts of a timeline against a literal loop, their sum over blocks, and metrics of statements at
ticks.
"""

import numpy as np
import pytest

from baselines import ThresholdDecider, record_statements, rollout
from baselines.scoring.statements import Statements, measure_statements
from baselines.scoring.timelines import Timeline, TimelineCounts, count_timeline
from hybrid_env import HybridTrackQuickestVectorEnv


def drawn(seed, moments=120):
    generator = np.random.default_rng(seed)
    modes, stated = (np.repeat(generator.integers(0, 3, 40), long)[:moments] for long in (6, 4))
    scored = np.repeat(generator.random(40) < 0.8, 3)[:moments]
    weights = np.where(scored, generator.random(moments), 0.0)
    times = np.cumsum(0.1 + generator.random(moments))
    samples = scored & (generator.random(moments) < 0.9)
    return Timeline(times, modes, stated, scored, weights, samples)


def literal_counts(timeline, normal):
    """The definitions of `TimelineCounts`, event by event."""
    times, modes, stated, scored, weights, samples = timeline
    total = dict.fromkeys(TimelineCounts._fields, 0.0)
    n = len(times)
    for k in range(n):
        total["scored"] += weights[k]
        total["agreed"] += weights[k] * (modes[k] == stated[k])
        total["normal"] += weights[k] * (modes[k] == normal)
        total["samples"] += samples[k]

    def runs(values):
        begins = [k for k in range(1, n) if values[k] != values[k - 1]]
        return zip(begins, [*begins[1:], n], strict=True)

    for begin, end in runs(modes):
        if scored[begin:end].mean() < 0.5:
            continue
        right = [k for k in range(begin, end) if stated[k] == modes[k]]
        waited = times[right[0] if right else min(end, n - 1)] - times[begin]
        total["undetected"] += waited
        back = modes[begin] == normal
        if not right and end == n:
            total["pending"] += 1
            continue
        total["switches"] += 1
        total["ends"] += back
        total["missed"] += not right
        total["missed_ends"] += back and not right
        total["delay"] += waited if right else 0.0
        total["delay_of_ends"] += waited if right and back else 0.0
    for begin, end in runs(stated):
        if scored[begin:end].mean() <= 0.5:
            continue
        true = set(modes[begin:end].tolist())
        total["changes"] += 1
        total["false"] += stated[begin] not in true
        total["false_alarms"] += true == {normal} and stated[begin] != normal
    return list(total.values())


@pytest.mark.parametrize("seed", range(3))
def test_counts_equal_those_of_a_literal_loop_also_in_blocks(seed):
    timeline = drawn(seed)
    expected = literal_counts(timeline, normal=1)
    (counts,) = count_timeline(timeline, normal=1)
    parts = count_timeline(timeline, normal=1, blocks=np.repeat([0, 1, 3], 40))

    np.testing.assert_allclose(counts, expected, atol=1e-12)
    assert not parts[2].any()
    np.testing.assert_allclose(parts.sum(0), expected, atol=1e-12)
    # Without a normal mode there are no false alarms.
    (counts,) = count_timeline(timeline)
    assert TimelineCounts(*counts).false_alarms == 0 < TimelineCounts(*counts).false


def test_statements_at_ticks_are_counted_as_those_at_samples():
    generator = np.random.default_rng(0)
    true, stated = (
        np.repeat(generator.integers(0, 3, (40, 7)), ticks, axis=0)[:60] for ticks in (5, 2)
    )
    every = np.ones(60, np.bool_)
    metrics = measure_statements(Statements(true, stated))
    for track, counted in enumerate(metrics.values):
        line = Timeline(
            np.arange(60.0), true[:, track], stated[:, track], every, every * 1.0, every
        )
        counts = TimelineCounts(*count_timeline(line)[0])
        assert (
            dict(zip(metrics.columns(), counted, strict=True)).items()
            >= {
                "right": counts.agreed / counts.scored,
                "switches": counts.switches + counts.pending,
                "delay": counts.delay,
                "detected": counts.switches - counts.missed,
                "missed": counts.missed,
                "stated_changes": counts.changes,
            }.items()
        )


def test_the_reward_is_that_of_the_environment():
    options = {"ticks": 120, "durations": "uniform 10-30", "change_cost": 3.0}
    decider = ThresholdDecider(0.5)
    metrics = measure_statements(record_statements(decider, 30, 8, **options), change_cost=3.0)
    env = HybridTrackQuickestVectorEnv(30, **options)
    total = np.zeros(30)
    for now in rollout(env, decider, 8):
        total += now.rewards
        if now.step == 120:
            break

    np.testing.assert_allclose(metrics.reward, total / 120, rtol=1e-12)
    assert metrics.wrong_changes.sum() > 0
