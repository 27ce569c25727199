"""A bound on the reward of any decision rule for announced switches."""

import numpy as np

from agents.evaluation.task import Task
from baselines.rules.msprt import error_and_best
from baselines.rules.rollout import rollout
from baselines.scoring.scores import Scores
from hybrid_env.checks import FloatArray
from hybrid_env.registration import make_vector_env


def bound_scores(task: Task, episodes: int, seed: int) -> Scores:
    """Return the mean of max_k (2 max p_k - 1 - c k) over the segments of each episode, as the
    reward of a decider. Only a task with declarations has this bound.

    p_k is the posterior of what is rewarded after k ticks, c the cost of a tick, and k goes over
    the ticks at which a decision is asked for. A declaration at k earns 2 max p_k - 1 - c k at most
    on average, and a rule does not know at which k this is largest. The filters are those of the
    anchor-aware bank, which all run on: a rule on them earns less than the bound on average, as far
    as the posterior is right.
    """
    size = task.batch()
    parts = [
        _largest(task, min(size, episodes - first), seed + first)
        for first in range(0, episodes, size)
    ]
    values = np.concatenate(parts)[:, None, None]
    return Scores("bound", "", (0.0,), ("reward",), values)


def _largest(task: Task, episodes: int, seed: int) -> FloatArray:
    """Return the mean over segments of the largest expected reward, (episodes,)."""
    given = task.options
    options = {
        **vars(given),
        "bank": "oracle" if given.bank == "oracle" else "anchor_aware",
        "follow": "bank",
        "evidence": 0.0,
        "actions": "all",
        "observation": "bank",
        "reset_covariance": None,
    }
    env = make_vector_env("HybridTrackPublished-v0", episodes, tick_info=False, **options)
    layout = env.world.layout
    largest = np.full((episodes, env.options.segments), -np.inf)
    running = np.ones(episodes, np.bool_)
    tracks = np.arange(episodes)

    for now in rollout(env, lambda rows: np.zeros(len(rows), np.int64), seed):
        running &= ~(now.terminated & (now.step > 0))
        if not running.any():
            break
        odds = np.exp(layout.read(now.observation, "log_ratio"))
        error, _ = error_and_best(odds / odds.sum(-1, keepdims=True), env.options.groups)
        earned = 1.0 - 2.0 * error - given.delay_cost * env.world.field("tick")
        places = tracks[running], env.world.field("segment")[running]
        largest[places] = np.maximum(largest[places], earned[running])
    return largest.mean(1)
