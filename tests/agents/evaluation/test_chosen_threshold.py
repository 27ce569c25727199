"""Deciders that choose their threshold: for the reward, or for a promised error rate."""

import warnings

import numpy as np
import pytest

from agents.evaluation.registry import find_decider
from agents.evaluation.task import sweep
from agents.evaluation.tasks import task_of
from baselines import MSPRTDecider
from hybrid_env import ArgumentError

HOME = "HybridTrackPublished-v0"


@pytest.fixture(scope="module", autouse=True)
def few_episodes():
    from agents.evaluation import chosen_threshold

    patch = pytest.MonkeyPatch()
    patch.setattr(chosen_threshold, "EPISODES", {"announced": 150, "unknown": 4})
    yield
    patch.undo()


@pytest.mark.parametrize(
    "name",
    ["ate:0%", "ate:50%", "ate:-1%", "ate:x%", "ate:nan%", "ate:2/1000", "fixed:auto:3"],
)
def test_other_endings_are_refused(name):
    with pytest.raises(ArgumentError, match="decider"):
        find_decider(name, task_of(HOME, {}).options)


def alpha_of(name, **options):
    decider = find_decider(name, task_of(HOME, options).options)
    decider = decider.at(decider.threshold)
    assert isinstance(decider, MSPRTDecider)
    return decider.threshold


def test_the_threshold_for_the_reward_depends_on_the_delay_cost():
    chosen = alpha_of("msprt:auto")
    assert chosen in find_decider("msprt", task_of(HOME, {}).options).thresholds
    # Waiting costs more.
    assert chosen < alpha_of("msprt:auto", delay_cost=0.1)


def test_a_promised_error_rate_is_held_on_other_episodes():
    for rate, noise in (
        (0.03, "gaussian"),
        (0.1, "gaussian"),
        (0.2, "student_t 3"),
    ):
        task = task_of(HOME, {"noise": noise})
        scores = sweep(task, find_decider(f"msprt:{100 * rate:g}%", task.options), 300, 0)
        error = 1.0 - float(scores.curve(task.statistic("accuracy"))[0])
        # Episodes near the rate.
        counting = 2.0 * np.sqrt(rate / 300 / 6) + 2.0 * np.sqrt(rate / 450 / 6)
        assert abs(error - rate) < counting


def test_a_rate_that_cannot_be_held_is_told():
    options = {"speed": 0.2, "measurement_variance": 1.0}
    with pytest.warns(UserWarning, match=r"MSPRT cannot hold a rate of 1%: \d"):
        alpha_of("msprt:1%", **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        alpha_of("msprt:10%")


def test_unknown_switches_have_a_reward_and_a_rate_of_wrong_changes():
    task = task_of("HybridTrackQuickest-v0", {"ticks": 200})
    few, many = (
        find_decider(f"threshold:{rate}/1000", task.options).at(0.0).threshold for rate in (2, 8)
    )

    assert 0.5 < many < few < 1.0
    decider = find_decider("threshold:auto", task.options)
    assert decider.at(0.0).threshold in find_decider("threshold", task.options).thresholds
    with pytest.raises(ArgumentError, match="2/1000"):
        find_decider("threshold:2%", task.options)
