"""Statements of a decider on fixed episodes, with the true modes."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.rules.decider import Decider
from hybrid_env.checks import check_integer
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv


class Statements(NamedTuple):
    """What was true and what was stated on N tracks of T ticks.

    Attributes:
        true_modes: (T, N).
        stated_modes: (T, N).
    """

    true_modes: NDArray[np.int64]
    stated_modes: NDArray[np.int64]


def record_statements(decider: Decider, tracks: int, seed: int, **options: Any) -> Statements:
    """Run a decider on one episode of every track.

    Args:
        decider: a rule or agent whose action i states mode i. If it has a function `observe`, that is called
            with the `QuickestWorld`, and its result replaces the rows.
        tracks: N, number of episodes.
        seed: of the first track; track i has seed + i, so that deciders can be compared in pairs.
        options: see `hybrid_env.QuickestOptions`.

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """
    env = HybridTrackQuickestVectorEnv(tracks, autoreset_mode="Disabled", tick_info=False, **options)
    shape = env.options.ticks, env.num_envs
    recorded = Statements(np.empty(shape, np.int64), np.empty(shape, np.int64))
    rows, _ = env.reset(seed=check_integer("seed", seed, minimum=0))
    observe = getattr(decider, "observe", None)
    state, start = None, np.ones(env.num_envs, np.bool_)
    for k in range(env.options.ticks):
        recorded.true_modes[k] = env.world.field("true_mode")
        seen = observe(env.world) if observe is not None else rows
        actions, state = decider.predict(seen, state, start, deterministic=True)
        recorded.stated_modes[k] = actions
        rows, *_ = env.step(actions)
        start = np.zeros(env.num_envs, np.bool_)
    return recorded
