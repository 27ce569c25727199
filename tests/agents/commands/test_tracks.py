"""One track with the decisions of a decider, as it is shown."""

import numpy as np
import pytest

from agents.evaluation.episodes import Episodes, timeline
from agents.evaluation.task import task_of
from agents.figures.tracks import UNDECIDED
from baselines import SPRTDecider
from baselines.rules.rollout import record_decisions

ENV = "hybrid_env:HybridTrackPublished-v0"


def test_an_episode_agrees_with_the_evaluation():
    decisions = record_decisions(SPRTDecider(1e-3), episodes=4, seed=10, env_id=ENV)
    episodes = Episodes(task_of(ENV, {}), "ate:1e-3")
    list(episodes.play(12))
    history, shown = episodes.history, timeline(episodes.task, episodes.history)

    np.testing.assert_array_equal(shown["right"][shown["marks"]], decisions.correct[2])
    lengths = np.diff([*history.switches, len(history.points())])
    np.testing.assert_array_equal(lengths, decisions.length[2])
    undecided = np.add.reduceat(shown["modes"] == UNDECIDED, history.switches)
    np.testing.assert_array_equal(undecided, decisions.ticks[2])
    error = history.points("estimate_") - history.points()
    assert (error**2).sum() == pytest.approx(decisions.squared_error[2].sum())
