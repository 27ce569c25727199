"""Decisions every few ticks: the same episodes as of an environment that asks at every tick, whose
agent waits or repeats its statement in between.
"""

import gymnasium as gym
import numpy as np
import pytest

from hybrid_env import HybridTrackEnv, HybridTrackQuickestEnv
from hybrid_env.checks import ArgumentError
from hybrid_env.registration import ENVIRONMENTS

AWARE = {"bank": "anchor_aware"}
ANNOUNCED = [
    pytest.param({}, id="published"),
    pytest.param(AWARE, id="anchor-aware"),
    pytest.param(AWARE | {"evidence": 0.9}, id="mask"),
    pytest.param(ENVIRONMENTS["HybridTrackBank-v0"] | {"decide_every": 1}, id="types"),
    pytest.param({"observation": "raw", "missed": 0.2}, id="raw, missing ticks"),
    pytest.param({"observation": "state"}, id="state"),
    pytest.param({"modes": "straight, left 5, stop"}, id="own modes"),
    pytest.param({"sensors": ["0.4 period 3", "radar 0.5 0.01 rate 0.3"]}, id="radar"),
    pytest.param({"noise": "student_t 3"}, id="heavy tails"),
    pytest.param({"scheme": "S7 L12r5 S5"}, id="segments that end between"),
]


def announced_by_hand(options, every, act, seed):
    """Yield what each decision of an episode sees and earns that is asked at every tick: row, tick,
    and the reward of the waits that led to it and of its own step.
    """
    env = HybridTrackEnv(**options)
    row, info = env.reset(seed=seed)
    done = False
    while not done:
        rewards = []
        while info["tick"] % every and left_of(env):
            row, reward, done, _, info = env.step(0)
            rewards.append(reward)
        decided_on, tick = row, info["tick"]
        row, reward, done, _, info = env.step(act(row))
        yield decided_on, tick, sum(rewards) + reward


def left_of(env):
    block = env.world.blocks[0]
    return int(block["length"][0] - block["tick"][0])


@pytest.mark.parametrize("options", ANNOUNCED)
def test_episodes_are_those_of_an_agent_that_waits_between(options):
    every = 5
    env = HybridTrackEnv(**options | {"decide_every": every})

    def act(row):
        # A function of the row, so that both environments see the same actions.
        number = int(np.abs(row.astype(float)).sum() * 1e4)
        return number % env.action_space.n if number % 3 == 0 else 0

    for seed in range(4):
        row, info = env.reset(seed=seed)
        done = False
        for expected, tick, earned in announced_by_hand(options, every, act, seed):
            assert not done
            np.testing.assert_array_equal(row, expected)
            assert info["tick"] == tick
            row, reward, done, _, info = env.step(act(row))
            assert reward == pytest.approx(earned, abs=1e-12)
        assert done


def test_statements_hold_for_so_many_ticks():
    every, ticks = 7, 200
    options = {"ticks": ticks, "durations": "uniform 5-30"}
    seldom = HybridTrackQuickestEnv(decide_every=every, **options)
    often = HybridTrackQuickestEnv(**options)
    for seed in range(3):
        row, _ = seldom.reset(seed=seed)
        expected, _ = often.reset(seed=seed)
        generator = np.random.default_rng(seed)
        steps, done = 0, False
        while not done:
            np.testing.assert_array_equal(row, expected)
            action = int(generator.integers(3))
            row, reward, done, *_ = seldom.step(action)
            steps += 1
            rewards = []
            for _ in range(every):
                expected, of_tick, ended, *_ = often.step(action)
                rewards.append(of_tick)
                if ended:
                    break
            assert reward == sum(rewards)
        assert ended
        assert steps == -(-ticks // every)


@pytest.mark.parametrize(
    ("env_id", "options", "allowed"),
    [
        ("HybridTrack-v0", {"decide_every": 51}, "at most 50"),
        ("HybridTrack-v0", {"decide_every": 6, "scheme": "S7 L5r5"}, "at most 5"),
        ("HybridTrackQuickest-v0", {"decide_every": 21, "ticks": 20}, "at most 20"),
    ],
)
def test_other_numbers_are_refused_in_one_line(env_id, options, allowed):
    with pytest.raises(ArgumentError, match=rf"^decide_every=.*{allowed}.*$"):
        gym.make(env_id, **options)
