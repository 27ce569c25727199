"""The posterior of the shipped agent is calibrated."""

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode

from agents.evaluation.registry import load_decider
from hybrid_env import HybridTrackVectorEnv, Layout

BINS = np.linspace(1.0 / 3.0, 1.0, 11)


def stated_and_right(decider, env, segments, ticks=(2, 5, 10, 20, 40)):
    """Stated probability of the likeliest hypothesis, and whether it is the true one.

    Recorded at some ticks of every segment, and at the decision.
    """
    rows, _ = env.reset(seed=11)
    state = None
    start = np.ones(env.num_envs, np.bool_)
    stated = []
    right = []
    decided = 0
    while decided < segments:
        state = decider.advance(rows, state, start)
        posterior = state.posterior
        best = posterior.argmax(1)
        declare = 1.0 - posterior.max(1) <= 0.02
        tick = np.rint(Layout.of_rows(rows).read(rows, "ticks"))
        recorded = declare | np.isin(tick, ticks)
        stated.append(posterior.max(1)[recorded])
        right.append((best == env.world.field("true_mode"))[recorded])
        decided += int(declare.sum())
        rows, _, start, _, _ = env.step(np.where(declare, best + 1, 0))
    return np.concatenate(stated), np.concatenate(right)


@pytest.mark.parametrize("R", [0.01, 0.1, 1.0])
@pytest.mark.parametrize("segments", [4_000, pytest.param(100_000, marks=pytest.mark.study)])
def test_every_bin_of_the_stated_probability_is_within_three_points(R, segments):
    torch.set_num_threads(1)
    env = HybridTrackVectorEnv(500, AutoresetMode.SAME_STEP, False, measurement_variance=R)
    stated, right = stated_and_right(load_decider("shipped", env.options), env, segments)
    index = np.digitize(stated, BINS[1:-1])
    for k in range(len(BINS) - 1):
        chosen = index == k
        count = chosen.sum()
        if count >= 100:
            mean = stated[chosen].mean()
            # Four standard errors of the sample.
            error = 4 * np.sqrt(mean * (1 - mean) / count)
            assert abs(mean - right[chosen].mean()) <= 0.03 + error
