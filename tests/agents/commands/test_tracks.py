"""One track with the decisions or statements of deciders, as it is drawn."""

import functools

import numpy as np
import pytest

from agents.evaluation.episodes import Episodes
from agents.evaluation.task import task_of
from agents.figures.tracks import UNDECIDED
from baselines import SPRTDecider, ThresholdDecider, record_statements
from baselines.rules import rollout
from baselines.scoring.statements import measure_statements

record_decisions = functools.partial(
    rollout.record_decisions, env_id="hybrid_env:HybridTrackPublished-v0"
)

ENV = "hybrid_env:HybridTrackPublished-v0"
STATED_ENV = "hybrid_env:HybridTrackQuickest-v0"
STATED = {"ticks": 150, "durations": "uniform 20-40"}


def record_track(name, rule, env_id, **options):
    return Episodes(task_of(env_id, options), name, rule).record(name, 12)


def test_a_recorded_episode_agrees_with_the_evaluation():
    decider = SPRTDecider(1e-3)
    decisions = record_decisions(decider, episodes=4, seed=10)
    record = record_track("ATE", decider, ENV)

    np.testing.assert_array_equal(record.right[record.marks], decisions.correct[2])
    lengths = np.diff([*record.switches, len(record.history.points())])
    np.testing.assert_array_equal(lengths, decisions.length[2])
    undecided = np.add.reduceat(record.modes == UNDECIDED, record.switches)
    np.testing.assert_array_equal(undecided, decisions.ticks[2])
    assert record.summary == f"{decisions.reward[2].mean():+.2f}"
    error = record.history.points("estimate_") - record.history.points()
    assert (error**2).sum() == pytest.approx(decisions.squared_error[2].sum())


def test_a_recorded_track_agrees_with_the_evaluation():
    metrics = measure_statements(record_statements(ThresholdDecider(0.6), 4, 10, **STATED))
    record = record_track("IMM threshold", ThresholdDecider(0.6), STATED_ENV, **STATED)

    np.testing.assert_array_equal(record.right, record.modes == record.history.true_modes)
    assert record.right.mean() == pytest.approx(metrics.right[2])
    assert record.summary.startswith(f"{100 * record.right.mean():.1f} % of the ticks right, mean")
