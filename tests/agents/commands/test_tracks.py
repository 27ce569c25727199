"""One track with the decisions or statements of deciders, as it is drawn."""

import functools

import numpy as np
import pytest

from agents.commands.play import Episodes
from agents.evaluation.tasks import task_of
from agents.figures.tracks import UNDECIDED
from baselines import CusumDecider, SPRTDecider, ThresholdDecider, record_statements
from baselines.rules import rollout
from baselines.scoring.statements import measure_statements

evaluate = functools.partial(rollout.evaluate, env_id="hybrid_env:HybridTrackPublished-v0")

ENV = "hybrid_env:HybridTrackPublished-v0"
STATED_ENV = "hybrid_env:HybridTrackQuickest-v0"
STATED = {"ticks": 150, "durations": "uniform 20-40"}


def record_track(name, rule, env_id, seed, **options):
    return Episodes(task_of(env_id, options), name, rule).record(name, seed)


@pytest.fixture(scope="module")
def stated():
    rules = {"IMM threshold": ThresholdDecider(0.6), "CUSUM": CusumDecider(2.0)}
    return [record_track(name, rule, STATED_ENV, 12, **STATED) for name, rule in rules.items()]


def test_a_recorded_episode_agrees_with_the_evaluation():
    decider = SPRTDecider(1e-3)
    decisions = evaluate(decider, episodes=4, seed=10)
    record = record_track("ATE", decider, ENV, 12)
    lengths = decisions.length[2]

    np.testing.assert_array_equal(
        record.right[record.marks],
        decisions.correct[2],
    )
    np.testing.assert_array_equal(
        np.diff([*record.switches, len(record.truth)]),
        lengths,
    )
    np.testing.assert_array_equal(
        record.marks + 1 - record.switches,
        decisions.ticks[2],
    )
    undecided = np.add.reduceat(record.modes == UNDECIDED, record.switches)
    np.testing.assert_array_equal(undecided, decisions.ticks[2])
    assert record.summary == f"{decisions.reward[2].mean():+.2f}"
    error = record.estimates - record.truth
    assert (error**2).sum() == pytest.approx(decisions.squared_error[2].sum())


def test_a_recorded_track_agrees_with_the_evaluation(stated):
    metrics = measure_statements(record_statements(ThresholdDecider(0.6), 4, 10, **STATED))
    first, second = stated

    np.testing.assert_array_equal(first.right, first.modes == first.true_modes)
    assert first.right.mean() == pytest.approx(metrics.right[2])
    assert first.summary.startswith(
        f"{100 * first.right.mean():.1f} % of the ticks right, mean delay "
    )
    # 2 m/s for .1 s, twice.
    assert np.hypot(*np.diff(first.truth, axis=0).T).max() < 0.4
    assert 0.5 < (first.measurements - first.truth).std() / np.sqrt(0.1) < 1.5
    np.testing.assert_array_equal(first.truth, second.truth)
