"""Deciders that choose their threshold: for the reward, or for a promised error rate."""

import numpy as np
import pytest

from agents.evaluation.registry import find_decider
from agents.evaluation.task import AnnouncedTask, UnknownTask, sweep, task_of

HOME = "HybridTrackPublished-v0"


@pytest.fixture(scope="module", autouse=True)
def few_episodes():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(AnnouncedTask, "choosing_episodes", 150)
        patch.setattr(UnknownTask, "choosing_episodes", 4)
        yield


def chosen(name, env_id=HOME, **options):
    """The threshold that a decider chooses; the decider of a name decides at it."""
    decider = find_decider(name, task_of(env_id, options).options)
    return decider.at(decider.threshold).threshold


def test_the_threshold_for_the_reward_depends_on_the_delay_cost():
    alpha = chosen("msprt:auto")
    assert alpha in find_decider("msprt", task_of(HOME).options).thresholds
    # Waiting costs more.
    assert alpha < chosen("msprt:auto", delay_cost=0.1)


@pytest.mark.parametrize(("rate", "noise"), [(0.03, "gaussian"), (0.2, "student_t 3")])
def test_a_promised_error_rate_is_held_on_other_episodes(rate, noise):
    task = task_of(HOME, {"noise": noise})
    scores = sweep(task, find_decider(f"msprt:{100 * rate:g}%", task.options), 300, 0)
    error = 1.0 - float(scores.curve(task.statistic("accuracy"))[0])
    # Episodes near the rate.
    counting = 2.0 * np.sqrt(rate / 300 / 6) + 2.0 * np.sqrt(rate / 450 / 6)
    assert abs(error - rate) < counting


def test_unknown_switches_have_a_reward_and_a_rate_of_wrong_changes():
    env_id, options = "HybridTrackQuickest-v0", {"ticks": 200}
    few, many = (chosen(f"threshold:{rate}/1000", env_id, **options) for rate in (2, 8))

    assert 0.5 < many < few < 1.0
