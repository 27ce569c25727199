"""One track with the decisions or statements of deciders, as it is drawn."""

import functools

import numpy as np
import pytest

from agents.evaluation.episodes import Episodes
from agents.evaluation.task import task_of
from agents.figures.tracks import UNDECIDED
from baselines import SPRTDecider
from baselines.rules import rollout

record_decisions = functools.partial(
    rollout.record_decisions, env_id="hybrid_env:HybridTrackPublished-v0"
)

ENV = "hybrid_env:HybridTrackPublished-v0"


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
