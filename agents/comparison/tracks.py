"""What a decider declares or states on one simulated track."""

from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from agents.figures.timelines import UNDECIDED
from agents.figures.tracks import TrackRecord
from baselines.rules.metrics import measure_statements
from baselines.rules.statements import Statements
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.rendering.history import ACTIVE, TRACE_INDEX, History
from hybrid_env.track_env import TrackEnv


def record_track(name: str, decider: Any, env_id: str, seed: int, **options: Any) -> TrackRecord:
    """Run a decider on one track and note every tick.

    Args:
        name: of the decider.
        decider: as in `Decider`.
        env_id: registered id of an environment with announced or with unknown switch moments.
        seed: of the track.
        options: keyword arguments of the environment.
    """
    env = gym.make(env_id, render_mode="rgb_array", **options).unwrapped
    assert isinstance(env, TrackEnv)
    assert env.history is not None
    observe = getattr(decider, "observe", None)
    observation, _ = env.reset(seed=seed)
    start, state, terminated, rewards = np.ones(1, np.bool_), None, False, 0.0
    while not terminated:
        rows = observation[None] if observe is None else observe(env.world)
        actions, state = decider.predict(rows, state=state, episode_start=start, deterministic=True)
        observation, reward, terminated, _, _ = env.step(int(actions[0]))
        rewards, start = rewards + reward, np.zeros(1, np.bool_)
    history = env.history
    modes = history.trace[:, ACTIVE].astype(np.int64)
    right = modes == history.true_modes
    marks = np.flatnonzero(np.diff(modes, prepend=modes[:1]))
    if history.decisions:
        marks = np.array([decision.time for decision in history.decisions]) - 1
        lengths = [decision.length for decision in history.decisions]
        modes[~np.isnan(history.evidence).all(1)] = UNDECIDED
        right = np.repeat([decision.correct for decision in history.decisions], lengths)
        summary = f"{rewards / len(marks):+.2f}"
    else:
        summary = _statement_summary(history.true_modes, modes, env.options)
    return TrackRecord(
        name=name,
        truth=_positions(history, ""),
        measurements=_positions(history, "measured_"),
        true_modes=history.true_modes,
        modes=modes,
        right=right,
        marks=marks,
        switches=history.switches if history.decisions else None,
        estimates=_positions(history, "estimate_"),
        summary=summary,
    )


def _positions(history: History, which: str) -> NDArray[np.float64]:
    return history.trace[:, [TRACE_INDEX[f"{which}{axis}"] for axis in "xy"]]


def _statement_summary(true: NDArray[np.int64], stated: NDArray[np.int64], options: QuickestOptions) -> str:
    metrics = measure_statements(Statements(true[:, None], stated[:, None]), options.change_cost)
    right, reward = f"{100 * metrics.right[0]:.1f} %", f"{metrics.reward[0]:.3f}"
    delay = f"mean delay {metrics.mean_delay:.1f} ticks" if metrics.delays.size else "no switch detected"
    wrong = round(1e-3 * len(true) * float(metrics.wrong_changes[0]))
    return f"{right} of the ticks right, {delay}, {wrong} changes to a wrong mode, mean reward {reward}"
