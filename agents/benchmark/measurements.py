"""Speed of the environment and the bank beside what people would use instead.

Every comparison runs the two sides in turn, A B A B, in one process; its figure is the median of the ratios
pair by pair, so that a drift of the machine's speed falls on both sides.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import SyncVectorEnv, VectorEnv

from agents.benchmark.peers import FilterpyBank, NumpyBank, has_filterpy
from agents.training.recipe import PPOSettings, load_recipe
from baselines.papers import golubkov2018
from hybrid_env import HybridTrackEnv, KalmanBank
from hybrid_env.core.published_bank import FloatArray
from hybrid_env.registration import make_vector_env
from hybrid_env.simulation import simulate

REPETITIONS = 7
SECONDS = 0.05  # of one measurement, about
BANK_RADII = tuple(float(radius) for radius in range(1, 11))
BANKS: dict[str, tuple[float, ...]] = {"3 hypotheses": (5.0,), "21 hypotheses": BANK_RADII}
DECLARE_EVERY = 25  # steps, in the runs with declarations


@dataclass(frozen=True)
class Measurement:
    """One line of the report.

    Attributes:
        group, name: what is measured.
        value: the figure, a ratio where `goal` is one.
        low, high: its range over repetitions.
        unit: of the figure; "x" means times as fast as the other.
        goal: what is aimed at, None where it is only stated; `at_most` says which side.
        detail: absolute times.
    """

    group: str
    name: str
    value: float
    low: float
    high: float
    unit: str
    goal: float | None = None
    at_most: bool = False
    detail: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the goal is reached; None without one."""
        if self.goal is None:
            return None
        return self.value <= self.goal if self.at_most else self.value >= self.goal


def seconds_per_call(function: Callable[[], Any], least: float | None = None) -> float:
    """Time of a call [s], over as many calls as take the least time."""
    least = SECONDS if least is None else least
    count = 1
    while True:
        started = time.perf_counter()
        for _ in range(count):
            function()
        elapsed = time.perf_counter() - started
        if elapsed >= least:
            return elapsed / count
        count = max(count + 1, int(count * min(1.2 * least / max(elapsed, 1e-9), 100.0)))


def in_turn(
    ours: Callable[[], Any],
    theirs: Callable[[], Any],
    repetitions: int | None = None,
    least: float | None = None,
) -> tuple[list[float], list[float]]:
    """Seconds a call of two functions, measured A B A B after one call of each."""
    ours()
    theirs()
    pairs = [
        (seconds_per_call(ours, least), seconds_per_call(theirs, least))
        for _ in range(repetitions or REPETITIONS)
    ]
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs]


def faster(
    group: str,
    name: str,
    ours: list[float],
    theirs: list[float],
    goal: float | None = None,
    share: float = 1.0,
) -> Measurement:
    """How many times as fast: theirs over ours, times the work that one of our calls does of theirs."""
    ratios = sorted(share * other / own for own, other in zip(ours, theirs, strict=True))
    detail = f"{_time(float(np.median(ours)))} against {_time(float(np.median(theirs)))}"
    return Measurement(group, name, float(np.median(ratios)), ratios[0], ratios[-1], "x", goal, detail=detail)


def _time(seconds: float) -> str:
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("us", 1e6)):
        if seconds * scale >= 1.0:
            return f"{seconds * scale:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def _step(env: Any, action: Any) -> Callable[[], Any]:
    """A call that takes one step."""
    return lambda: env.step(action)


def single_environment() -> Iterator[Measurement]:
    """One track against CartPole-v1 without wrappers, info included, waiting."""
    cartpole = gym.make("CartPole-v1").unwrapped
    cartpole.reset(seed=0)
    for (name, radii), goal in zip(BANKS.items(), (2.0, 1.8), strict=True):
        env = HybridTrackEnv(radii=radii)
        env.reset(seed=0)
        ours, theirs = in_turn(partial(_step_or_reset, env, 0), partial(_step_or_reset, cartpole, 1))
        yield faster("single environment against CartPole-v1", name, ours, theirs, goal)


def _step_or_reset(env: Any, action: int) -> None:
    if env.step(action)[2]:
        env.reset()


def vector_environment() -> Iterator[Measurement]:
    """N tracks against CartPole's vector entry point, waiting and with declarations, and SyncVectorEnv."""
    goals = {
        "3 hypotheses": {8: 10.0, 64: 4.0, 1024: 0.7, 16384: 0.33},
        "21 hypotheses": {8: 6.0, 64: 1.6, 1024: 0.25, 16384: 0.12},
    }
    for declaring in (False, True):
        for bank, radii in BANKS.items():
            for tracks, goal in goals[bank].items():
                cartpoles = gym.make_vec("CartPole-v1", tracks, vectorization_mode="vector_entry_point")
                env = make_vector_env("hybrid_env:HybridTrack-v0", tracks, radii=radii, tick_info=False)
                runner = _Steps(env, 1.0 / DECLARE_EVERY if declaring else 0.0)
                times = in_turn(runner.step, _cartpoles(cartpoles))
                way = "1 declaration in 25, world ticks" if declaring else "waiting"
                group = f"vector environment against CartPole's, {way}"
                name = f"{bank}, {tracks:,} tracks"
                yield faster(group, name, *times, goal, share=runner.ticks_per_step)
    sync = SyncVectorEnv([lambda: gym.make("CartPole-v1")] * 64)
    env = make_vector_env("hybrid_env:HybridTrack-v0", 64, tick_info=False)
    env.reset(seed=0)
    wait = np.zeros(64, np.int64)
    times = in_turn(_step(env, wait), _cartpoles(sync))
    yield faster("vector environment against CartPole in SyncVectorEnv", "3 hypotheses, 64 tracks", *times)


def banks() -> Iterator[Measurement]:
    """The anchor-aware bank against the published one, 1,024 tracks waiting."""
    for name, radii in BANKS.items():
        steps = []
        for bank in ("anchor_aware", "published"):
            env = make_vector_env("hybrid_env:HybridTrack-v0", 1024, radii=radii, bank=bank, tick_info=False)
            env.reset(seed=0)
            steps.append(_step(env, np.zeros(1024, np.int64)))
        ours, theirs = in_turn(steps[0], steps[1])
        goal = 0.25 if name == "3 hypotheses" else None
        yield faster("anchor-aware bank against the published, 1,024 tracks", name, ours, theirs, goal)


def _cartpoles(env: VectorEnv[Any, Any, Any]) -> Callable[[], Any]:
    env.reset(seed=0)
    return _step(env, np.random.default_rng(0).integers(0, 2, env.num_envs))


class _Steps:
    """Steps in which some tracks declare, and the world ticks of a track that one step takes on average."""

    def __init__(self, env: Any, declaring: float):
        self.env = env
        generator = np.random.default_rng(1)
        chosen = generator.random((64, env.num_envs)) < declaring
        self.rows = chosen.astype(np.int64)
        self.turn = 0
        env.reset(seed=0)
        ticks = 0.0
        for _ in range(256):
            info = self.step()
            # a declaration at its k-th tick runs the rest of the segment and the first tick of the next
            decided = info.get("_ticks")
            ran = 0 if decided is None else int((info["decided_length"] - info["ticks"])[decided].sum())
            ticks += env.num_envs + ran
        self.ticks_per_step = ticks / 256 / env.num_envs

    def step(self) -> dict[str, Any]:
        self.turn = (self.turn + 1) % len(self.rows)
        info: dict[str, Any] = self.env.step(self.rows[self.turn])[4]
        return info


def bank_step() -> Iterator[Measurement]:
    """One tick of a bank against filterpy's KalmanFilter and plain NumPy, a 4x4 filter a hypothesis."""
    measurement = np.array([0.1, 0.2])
    for name, radii in BANKS.items():
        bank = KalmanBank(radii)
        bank.anchor(golubkov2018.START)
        for other, peer in (("NumPy 4x4", NumpyBank), ("filterpy", FilterpyBank)):
            if peer is NumpyBank or has_filterpy():
                ours, theirs = in_turn(
                    partial(bank.step, measurement), partial(peer(radii).step, measurement)
                )
                yield faster("bank step", f"{name}, against {other}", ours, theirs)


def study_2018() -> Iterator[Measurement]:
    """ATE over 100 runs of the 2018 scheme against filterpy filters, extrapolated from some ticks."""
    if not has_filterpy():
        return
    recording = simulate(golubkov2018.SCHEME, 100, 0, start=golubkov2018.START)
    bank_ticks = int(golubkov2018.run_ate(recording, 0.1).ticks.sum())  # while the whole bank runs
    alone_ticks = recording.measurements[:, :, 0].size - bank_ticks
    z = np.array([0.1, 0.2])
    bank, alone = FilterpyBank(golubkov2018.RADII), FilterpyBank(())
    ours, theirs = [], []
    for _ in range(REPETITIONS):
        ours.append(seconds_per_call(lambda: golubkov2018.run_ate(recording, 0.1)))
        bank_time, alone_time = (seconds_per_call(partial(peer.step, z)) for peer in (bank, alone))
        theirs.append(bank_ticks * bank_time + alone_ticks * alone_time)
    yield faster(
        "2018 study against filterpy loops", f"100 runs, R2, from {SECONDS} s of each kind of tick",
        ours, theirs, 2000.0,
    )  # fmt: skip


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
    for _ in range(REPETITIONS):
        inside[0] = 0.0
        started = time.perf_counter()
        ours_model.learn(2 * steps)
        ours.append(time.perf_counter() - started)
        shares.append(inside[0] / ours[-1])
        started = time.perf_counter()
        theirs_model.learn(2 * steps)
        theirs.append(time.perf_counter() - started)
    group = "PPO, 256 tracks, batch 8,192, 4 epochs"
    yield faster(group, "steps a second against CartPole", ours, theirs, 1.5)
    percent = sorted(100.0 * share for share in shares)
    yield Measurement(
        group, "environment's share", float(np.median(percent)), percent[0], percent[-1], "%", 8.0,
        at_most=True, detail=f"{2 * steps / float(np.median(ours)):,.0f} steps/s",
    )  # fmt: skip


def growth() -> Iterator[Measurement]:
    """Exponents of time over the upper decade of tracks and hypotheses, time over segment length, memory."""

    def nanoseconds(worlds: list[tuple[int, int, str]]) -> FloatArray:
        """(REPETITIONS, worlds) of a step a track, measured in turn; each world: tracks, radii, scheme."""
        steps = []
        for tracks, radii, scheme in worlds:
            env = make_vector_env(
                "hybrid_env:HybridTrack-v0", tracks, radii=tuple(range(1, radii + 1)), scheme=scheme,
                correctness="type", tick_info=False,
            )  # fmt: skip
            env.reset(seed=0)
            wait = np.zeros(tracks, np.int64)
            env.step(wait)
            steps.append(_step(env, wait))
        rounds = [[seconds_per_call(step) for step in steps] for _ in range(REPETITIONS)]
        return 1e9 * np.array(rounds) / [tracks for tracks, _, _ in worlds]

    def growing(
        name: str,
        figures: FloatArray,
        costs: FloatArray,
        sizes: Sequence[int],
        of: str,
        goal: float | None = None,
    ) -> Measurement:
        shown = ", ".join(
            f"{size:,}{of}: {cost:,.0f} ns"
            for size, cost in zip(sizes, np.median(costs, axis=0), strict=True)
        )
        low, middle, high = np.percentile(figures, [0, 50, 100])
        detail = f"{shown} a track"
        return Measurement("growth", name, middle, low, high, "", goal, at_most=True, detail=detail)

    def exponents(sizes: Sequence[int], times: FloatArray) -> FloatArray:
        upper = np.array(sizes) >= sizes[-1] / 10
        return np.asarray(np.polyfit(np.log(sizes)[upper], np.log(times[:, upper]).T, 1)[0])

    tracks = (1, 16, 256, 4096, 8192, 16384, 65536)
    costs = nanoseconds([(count, 1, "random") for count in tracks])
    yield growing("exponent in tracks", exponents(tracks, costs * tracks), costs, tracks, "", 1.1)
    hypotheses = (3, 21, 41, 101, 201)
    costs = nanoseconds([(512, count // 2, "random") for count in hypotheses])
    yield growing("exponent in hypotheses", exponents(hypotheses, costs), costs, hypotheses, "", 1.1)
    lengths = (10, 100, 1000, 10_000)
    costs = nanoseconds([(512, 1, f"random 6x{length}") for length in lengths])
    yield growing("long segments against 100 ticks", costs[:, -1] / costs[:, 1], costs, lengths, " ticks")
    for name, radii in BANKS.items():
        env = make_vector_env("hybrid_env:HybridTrack-v0", 1024, radii=radii)
        size = env.world.nbytes / 1024
        yield Measurement("memory", f"a track, {name}", size, size, size, "bytes")


def start_up() -> Iterator[Measurement]:
    """The first step after import, each in a new process, with an empty and with a filled compile cache."""
    code = (
        "import hybrid_env, time; t = time.perf_counter(); "
        "env = hybrid_env.HybridTrackEnv(); env.reset(seed=0); env.step(0); print(time.perf_counter() - t)"
    )
    seconds = []
    for _ in range(REPETITIONS):
        with tempfile.TemporaryDirectory() as folder:
            environment = os.environ | {"NUMBA_CACHE_DIR": folder}
            for _ in ("empty", "filled"):
                command = [sys.executable, "-c", code]
                seconds.append(float(subprocess.check_output(command, env=environment, text=True)))
    for name, goal, taken in (
        ("first step, empty cache", 3.0, seconds[::2]),
        ("first step, filled cache", 1.0, seconds[1::2]),
    ):
        low, middle, high = np.percentile(taken, [0, 50, 100])
        yield Measurement("start-up", name, middle, low, high, "s", goal, at_most=True)


GROUPS: dict[str, Callable[[], Iterator[Measurement]]] = {
    "single": single_environment,
    "vector": vector_environment,
    "banks": banks,
    "bank": bank_step,
    "study": study_2018,
    "training": training,
    "growth": growth,
    "startup": start_up,
}
