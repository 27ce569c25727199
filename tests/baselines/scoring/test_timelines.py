"""Counts of a timeline against a literal loop, and their sum over blocks."""

import numpy as np
import pytest

from baselines.scoring.statements import COLUMNS, Statements, measure_statements
from baselines.scoring.timelines import Timeline, TimelineCounts, count_timeline


def drawn(seed, moments=120):
    generator = np.random.default_rng(seed)
    modes, stated = (
        np.repeat(
            generator.integers(
                0,
                3,
                40,
            ),
            long,
        )[:moments]
        for long in (6, 4)
    )
    scored = np.repeat(generator.random(40) < 0.8, 3)[:moments]
    weights = np.where(scored, generator.random(moments), 0.0)
    times = np.cumsum(0.1 + generator.random(moments))
    return Timeline(
        times,
        modes,
        stated,
        scored,
        weights,
        scored & (generator.random(moments) < 0.9),
    )


def literal_counts(timeline, normal):
    """The definitions of `TimelineCounts`, event by event."""
    total = dict.fromkeys(TimelineCounts._fields, 0.0)
    n = len(timeline.times)
    for k in range(n):
        total["scored"] += timeline.weights[k]
        total["agreed"] += timeline.weights[k] * (timeline.modes[k] == timeline.stated[k])
        total["normal"] += timeline.weights[k] * (timeline.modes[k] == normal)
        total["samples"] += timeline.samples[k]

    def runs(values):
        begins = [k for k in range(1, n) if values[k] != values[k - 1]]
        return zip(begins, [*begins[1:], n], strict=True)

    for begin, end in runs(timeline.modes):
        if timeline.scored[begin:end].mean() < 0.5:
            continue
        right = [k for k in range(begin, end) if timeline.stated[k] == timeline.modes[k]]
        when = right[0] if right else min(end, n - 1)
        waited = timeline.times[when] - timeline.times[begin]
        total["undetected"] += waited
        back = timeline.modes[begin] == normal
        if right:
            total["switches"] += 1
            total["delay"] += waited
            total["ends"] += back
            total["delay_of_ends"] += back * waited
        elif end < n:
            total["switches"] += 1
            total["missed"] += 1
            total["ends"] += back
            total["missed_ends"] += back
        else:
            total["pending"] += 1
    for begin, end in runs(timeline.stated):
        if timeline.scored[begin:end].mean() <= 0.5:
            continue
        true = set(timeline.modes[begin:end].tolist())
        total["changes"] += 1
        total["false"] += timeline.stated[begin] not in true
        total["false_alarms"] += true == {normal} and timeline.stated[begin] != normal
    return list(total.values())


@pytest.mark.parametrize("seed", range(5))
def test_counts_equal_those_of_a_literal_loop_also_in_blocks(seed):
    timeline = drawn(seed)
    expected = literal_counts(timeline, normal=1)

    np.testing.assert_allclose(
        count_timeline(timeline, normal=1)[0],
        expected,
        atol=1e-12,
    )
    blocks = np.repeat([0, 1, 3], 40)
    parts = count_timeline(timeline, normal=1, blocks=blocks)
    assert parts.shape == (4, len(TimelineCounts._fields))
    assert not parts[2].any()
    np.testing.assert_allclose(parts.sum(0), expected, atol=1e-12)


def test_without_a_normal_mode_there_are_no_false_alarms():
    counts = TimelineCounts(*count_timeline(drawn(0))[0])
    assert counts.false > 0
    assert counts.false_alarms == 0


def test_statements_at_ticks_are_counted_as_those_at_samples():
    generator = np.random.default_rng(0)
    true, stated = (
        np.repeat(
            generator.integers(0, 3, (40, 7)),
            ticks,
            axis=0,
        )[:60]
        for ticks in (5, 2)
    )
    figures = measure_statements(Statements(true, stated)).figures
    every = np.ones(60, np.bool_)
    for track in range(7):
        line = Timeline(
            np.arange(60.0),
            true[:, track],
            stated[:, track],
            every,
            every.astype(float),
            every,
        )
        counts = TimelineCounts(*count_timeline(line)[0])
        at_ticks = dict(zip(COLUMNS, figures[track], strict=True))
        assert at_ticks["right"] == counts.agreed / counts.scored
        assert at_ticks["switches"] == counts.switches + counts.pending
        assert at_ticks["delay"] == counts.delay
        assert at_ticks["detected"] == counts.switches - counts.missed
        assert at_ticks["missed"] == counts.missed
        assert at_ticks["stated_changes"] == counts.changes
