"""Speed of whole programs: the tracker on a live sensor, and the training of PPO against that on
CartPole.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from agents.algorithms.ppo import PPOSettings
from agents.training.recipe import load_recipe
from baselines import CusumDecider, MSPRTDecider, OnlineTracker, SPRTDecider, ThresholdDecider
from hybrid_env import QuickestOptions, WorldOptions
from tools.bench import timing
from tools.bench.timing import Measurement, figure, measure_in_turn, speed_ratio

# Us of a measurement.
GOAL = 20.0
# Ticks between announced switches.
SEGMENT = 50

CASES: dict[str, tuple[Callable[[], OnlineTracker], float | None]] = {
    "unknown switches, threshold": (
        lambda: OnlineTracker(QuickestOptions(), ThresholdDecider()),
        GOAL,
    ),
    "unknown switches, CUSUM": (lambda: OnlineTracker(QuickestOptions(), CusumDecider()), None),
    "announced switches, MSPRT": (lambda: OnlineTracker(WorldOptions(), MSPRTDecider()), GOAL),
    "announced switches, SPRT": (lambda: OnlineTracker(WorldOptions(), SPRTDecider()), None),
}
"""How each tracker is made, and its goal [us]."""


def online_tracker() -> Iterator[Measurement]:
    """A measurement of an object on a straight line, its time included, with 3 hypotheses."""
    for name, (make, goal) in CASES.items():
        tracker = make()
        measure = _sensor(tracker)
        for _ in range(SEGMENT):
            measure()
        row, decider = tracker.world.take_rows(), tracker.decider
        _, state = decider.predict(row, None, np.ones(1, np.bool_), True)
        asked = partial(decider.predict, row, state, np.zeros(1, np.bool_), True)
        times, alone = (1e6 * np.array(one) for one in measure_in_turn(measure, asked))
        yield figure(
            "on-line tracker, a measurement, 3 hypotheses",
            name,
            times,
            "us",
            goal=goal,
            at_most=True,
            detail=f"{np.median(alone):.3g} us a call of the decider alone",
        )


def _sensor(tracker: OnlineTracker) -> Callable[[], None]:
    """A call that feeds a tracker with the next noisy measurement of an object on a straight
    line.
    """
    noise = np.random.default_rng(0).normal(0.0, 0.3, (997, 2)).tolist()
    announced = isinstance(tracker.options, WorldOptions)
    tick = 0

    def measure() -> None:
        nonlocal tick
        tick += 1
        if announced and tick % SEGMENT == 0:
            tracker.switch(SEGMENT)
        x, y = noise[tick % len(noise)]
        tracker.update((0.2 * tick + x, y), 0.1 * tick)

    return measure


def training() -> Iterator[Measurement]:
    """PPO with 256 tracks against CartPole in DummyVecEnv, equal settings; the environment's
    share.
    """
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env

    from agents import as_vec_env

    torch.set_num_threads(1)
    recipe = load_recipe("ppo", "HybridTrackPublished-v0").settings
    assert isinstance(recipe, PPOSettings)
    tracks = 256
    rollout = 64
    steps = tracks * rollout
    settings: dict[str, Any] = {
        "n_steps": rollout,
        "batch_size": 8192,
        "n_epochs": 4,
        "device": "cpu",
        "seed": 0,
    }
    env = as_vec_env(num_envs=tracks)
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
    ours_model.learn(steps)
    theirs_model.learn(steps)
    ours = []
    theirs = []
    shares = []
    for _ in range(timing.REPETITIONS):
        inside[0] = 0.0
        ours.append(_seconds_of_training(ours_model, 2 * steps))
        shares.append(100.0 * inside[0] / ours[-1])
        theirs.append(_seconds_of_training(theirs_model, 2 * steps))
    group = "PPO, 256 tracks, batch 8,192, 4 epochs"
    yield speed_ratio(group, "steps a second against CartPole", ours, theirs, 1.5)
    rate = f"{2 * steps / float(np.median(ours)):,.0f} steps/s"
    yield figure(group, "environment's share", shares, "%", goal=8.0, at_most=True, detail=rate)


def _seconds_of_training(model: Any, steps: int) -> float:
    started = time.perf_counter()
    model.learn(steps)
    return time.perf_counter() - started
