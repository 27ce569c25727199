"""Speed of the environments against CartPole's, of the banks, and of threads."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import performance
from gymnasium.vector import SyncVectorEnv, VectorEnv

from hybrid_env import HybridTrackEnv, HybridTrackVectorEnv
from hybrid_env.registration import make_track_vector_env, make_vector_env
from tools.bench import timing
from tools.bench.timing import Measurement, figure, measure_in_turn, speed_ratio

BANK_RADII = tuple(float(radius) for radius in range(1, 11))
BANKS: dict[str, tuple[float, ...]] = {"3 hypotheses": (5.0,), "21 hypotheses": BANK_RADII}
ENV_ID = "hybrid_env:HybridTrackPublished-v0"
QUICKEST_ID = "hybrid_env:HybridTrackQuickest-v0"
# Steps, in the runs with declarations.
DECLARE_EVERY = 25


def waiting_step(env: Any) -> Callable[[], Any]:
    """A call that steps a reset vector environment with action 0: every track waits, or states
    mode 0.
    """
    wait = np.zeros(env.num_envs, np.int64)
    return lambda: env.step(wait)


def single_environment() -> Iterator[Measurement]:
    """One track against CartPole-v1 without wrappers, info included, waiting."""
    cartpole = gym.make("CartPole-v1").unwrapped
    cartpole.reset(seed=0)
    for (name, radii), goal in zip(BANKS.items(), (2.0, 1.8), strict=True):
        env = HybridTrackEnv(radii=radii)
        env.reset(seed=0)
        times = measure_in_turn(
            partial(_step_or_reset, env, 0), partial(_step_or_reset, cartpole, 1)
        )
        yield speed_ratio("single environment against CartPole-v1", name, *times, goal)


def _step_or_reset(env: Any, action: int) -> None:
    if env.step(action)[2]:
        env.reset()


def vector_environment() -> Iterator[Measurement]:
    """N tracks against CartPole's vector entry point, waiting and with declarations, and
    SyncVectorEnv.
    """
    for tracks in (8, 64):
        times = measure_in_turn(
            waiting_step(_tracks(tracks, tick_info=True)), _cartpole_step(tracks)
        )
        group = "vector environment against CartPole's, waiting, tick_info=True"
        yield speed_ratio(group, f"3 hypotheses, {tracks} tracks", *times)
    goals = {
        "3 hypotheses": {8: 10.0, 64: 4.0, 1024: 0.7, 16384: 0.33},
        "21 hypotheses": {8: 6.0, 64: 1.6, 1024: 0.25, 16384: 0.084},
    }
    for declaring in (False, True):
        for bank, radii in BANKS.items():
            for tracks, goal in goals[bank].items():
                runner = Steps(
                    _tracks(tracks, radii=radii), 1.0 / DECLARE_EVERY if declaring else 0.0
                )
                times = measure_in_turn(runner.step, _cartpole_step(tracks))
                way = "1 declaration in 25, simulated ticks" if declaring else "waiting"
                group = f"vector environment against CartPole's, {way}, tick_info=False"
                name = f"{bank}, {tracks:,} tracks"
                yield speed_ratio(group, name, *times, goal, work=runner.ticks_per_step)
    sync = SyncVectorEnv([lambda: gym.make("CartPole-v1")] * 64)
    times = measure_in_turn(waiting_step(_tracks(64)), _cartpole_step(64, sync))
    group = "vector environment against CartPole in SyncVectorEnv"
    yield speed_ratio(group, "3 hypotheses, 64 tracks", *times)


def gymnasium_benchmark() -> Iterator[Measurement]:
    """Steps a second of Gymnasium's own `benchmark_vector_step`, of N tracks and of CartPole. Two
    of three random actions are declarations, which run the rest of a segment within the step,
    mostly more than 50 ticks.
    """
    for tracks in (8, 64, 1024):
        for env_id in (ENV_ID, "CartPole-v1"):
            env = gym.make_vec(env_id, tracks, vectorization_mode="vector_entry_point")
            rates = [
                performance.benchmark_vector_step(env, timing.WHOLE_SECONDS, seed=0)
                for _ in range(3)
            ]
            name = f"{env_id.removeprefix('hybrid_env:')}, {tracks:,} tracks"
            yield figure(
                "benchmark_vector_step of Gymnasium, random actions", name, rates, "steps/s"
            )


def unknown_switches() -> Iterator[Measurement]:
    """Ticks a second with unknown switch moments against those with announced ones, N tracks."""
    for tracks in (1, 64, 1024):
        quickest = make_track_vector_env(QUICKEST_ID, tracks, tick_info=False)
        quickest.reset(seed=0)
        times = measure_in_turn(waiting_step(quickest), waiting_step(_tracks(tracks)))
        group = "HybridTrackQuickest-v0 against HybridTrackPublished-v0, tick_info=False"
        name = f"3 hypotheses, {tracks:,} track{'s' if tracks > 1 else ''}"
        yield speed_ratio(group, name, *times, 0.25)


def threads() -> Iterator[Measurement]:
    """Two threads against one, 16,384 tracks waiting."""
    for (name, radii), goal in zip(BANKS.items(), (1.7, None), strict=True):
        one, two = (waiting_step(_tracks(16384, radii=radii, threads=count)) for count in (1, 2))
        yield speed_ratio(
            "two threads against one, 16,384 tracks", name, *measure_in_turn(two, one), goal
        )


def banks() -> Iterator[Measurement]:
    """The anchor-aware bank against the published one, 1,024 tracks waiting."""
    for name, radii in BANKS.items():
        aware, published = (
            waiting_step(_tracks(1024, radii=radii, bank=bank))
            for bank in ("anchor_aware", "published")
        )
        goal = 0.25 if name == "3 hypotheses" else None
        group = "anchor-aware bank against the published bank, 1,024 tracks"
        yield speed_ratio(group, name, *measure_in_turn(aware, published), goal)


def _tracks(count: int, tick_info: bool = False, **options: Any) -> HybridTrackVectorEnv:
    """A vector environment that has been reset."""
    env = make_vector_env(ENV_ID, count, tick_info=tick_info, **options)
    env.reset(seed=0)
    return env


def _cartpole_step(count: int, env: VectorEnv[Any, Any, Any] | None = None) -> Callable[[], Any]:
    """A call that steps CartPole's vector environment with random actions."""
    if env is None:
        env = gym.make_vec("CartPole-v1", count, vectorization_mode="vector_entry_point")
    env.reset(seed=0)
    actions = np.random.default_rng(0).integers(0, 2, count)
    return lambda: env.step(actions)


class Steps:
    """Steps in which some tracks declare.

    Args:
        env: a vector environment that has been reset.
        declaring: share of the tracks that declare hypothesis 0 in a step.

    Attributes:
        ticks_per_step: mean number of simulated ticks of a track in a step.
    """

    def __init__(self, env: HybridTrackVectorEnv, declaring: float):
        self.env, self.turn = env, 0
        self.rows = (np.random.default_rng(1).random((64, env.num_envs)) < declaring).astype(
            np.int64
        )
        extra = 0
        for _ in range(256):
            info = self.step()
            decided = info.get("_ticks")
            if decided is not None:
                # A declaration at its k-th tick runs the rest of the segment and the first tick of
                # the next.
                extra += int((info["decided_length"] - info["ticks"])[decided].sum())
        self.ticks_per_step = 1.0 + extra / 256 / env.num_envs

    def step(self) -> dict[str, Any]:
        """Take one step and return its info."""
        self.turn = (self.turn + 1) % len(self.rows)
        info: dict[str, Any] = self.env.step(self.rows[self.turn])[4]
        return info
