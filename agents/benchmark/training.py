"""Speed of PPO on the environment against CartPole, and the environment's share of a training."""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from agents.benchmark import timing
from agents.benchmark.timing import Measurement, speed_ratio
from agents.training.recipe import load_recipe
from agents.training.settings import PPOSettings


def training() -> Iterator[Measurement]:
    """PPO with 256 tracks against CartPole in DummyVecEnv, equal settings; the environment's share."""
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env

    from agents.training.vec_env import HybridTrackVecEnv

    torch.set_num_threads(1)
    recipe = load_recipe("ppo", "HybridTrack-v0").settings
    assert isinstance(recipe, PPOSettings)
    tracks, rollout = 256, 64
    settings: dict[str, Any] = {
        "n_steps": rollout,
        "batch_size": 8192,
        "n_epochs": 4,
        "device": "cpu",
        "seed": 0,
    }
    env = HybridTrackVecEnv(num_envs=tracks)
    inside = [0.0]
    plain = env.step_wait

    def timed() -> Any:
        started = time.perf_counter()
        result = plain()
        inside[0] += time.perf_counter() - started
        return result

    env.step_wait = timed  # type: ignore[method-assign]
    ours_model = PPO("MlpPolicy", env, gamma=1.0, **settings)
    ours_model.policy.action_net.get_parameter("bias").data[0] = recipe.wait_bias
    theirs_model = PPO("MlpPolicy", make_vec_env("CartPole-v1", tracks), **settings)
    steps = tracks * rollout
    ours_model.learn(steps)
    theirs_model.learn(steps)
    ours, theirs, shares = [], [], []
    for _ in range(timing.REPETITIONS):
        inside[0] = 0.0
        started = time.perf_counter()
        ours_model.learn(2 * steps)
        ours.append(time.perf_counter() - started)
        shares.append(inside[0] / ours[-1])
        started = time.perf_counter()
        theirs_model.learn(2 * steps)
        theirs.append(time.perf_counter() - started)
    group = "PPO, 256 tracks, batch 8,192, 4 epochs"
    yield speed_ratio(group, "steps a second against CartPole", ours, theirs, 1.5)
    percent = sorted(100.0 * share for share in shares)
    yield Measurement(
        group, "environment's share", float(np.median(percent)), percent[0], percent[-1], "%", 8.0,
        at_most=True, detail=f"{2 * steps / float(np.median(ours)):,.0f} steps/s",
    )  # fmt: skip
