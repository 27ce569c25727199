"""Episodes with announced switches: the decisions of a decider, recorded."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.rules.rollout import rollout
from baselines.scoring.decisions import Decisions
from hybrid_env.checks import check_integer, reject
from hybrid_env.options import WorldOptions
from hybrid_env.registration import make_track_vector_env, make_vector_env

LARGEST_BATCH = 700_000_000  # bytes
LARGEST_RESULT = 10_000_000  # segments, which need half a gigabyte

DECIDED = {
    "correct": np.bool_, "type_correct": np.bool_, "ticks": np.int64, "forced": np.bool_,
    "decided_true_mode": np.int64, "decided_mode": np.int64, "decided_length": np.int64,
    "decided_squared_error": np.float64,
}  # fmt: skip
"""What `info` tells of a decision."""


def evaluate(
    decider: Any,
    env_id: str = "hybrid_env:HybridTrack-v0",
    episodes: int = 1000,
    seed: int = 0,
    on_progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Decisions:
    """Run a decider on the episodes with seeds seed, seed + 1, ..., each exactly once.

    All deciders face the same episodes: trajectories and noise do not depend on the decisions.

    Args:
        decider: see `baselines.rules.decider.Decider`.
        env_id: registered id.
        episodes: E; they run in parallel, one per track, in batches that need less than a gigabyte.
        seed: of the first episode.
        on_progress: called repeatedly with the fraction of finished segments.
        options: environment options that override those of the id.

    Raises:
        ArgumentError: the actions of the environment are not declarations of hypotheses.
    """
    given = make_track_vector_env(env_id, 1, **options).options
    check_episodes("episodes", episodes, given)
    size, batches = batch_size(given), []
    for first in range(0, episodes, size):
        count = min(size, episodes - first)

        def show(share: float, finished: int = first, width: int = count) -> None:
            if on_progress is not None:
                on_progress((finished + width * share) / episodes)

        batches.append(evaluate_batch(decider, env_id, count, seed + first, show, options))
    arrays = {
        field.name: np.concatenate([getattr(batch, field.name) for batch in batches])
        for field in dataclasses.fields(Decisions)
        if field.name != "delay_cost"
    }
    return Decisions(**arrays, delay_cost=given.delay_cost)


def evaluate_batch(
    decider: Any,
    env_id: str,
    episodes: int,
    seed: int,
    on_progress: Callable[[float], None],
    options: Mapping[str, Any],
) -> Decisions:
    """Run a decider on episodes that all run in parallel; see `evaluate`."""
    env = make_vector_env(env_id, episodes, tick_info=False, **options)
    if env.options.actions != "all":
        raise reject("actions", env.options.actions, "'all': deciders declare hypotheses")
    segments = env.options.segments
    recorded: dict[str, NDArray[Any]] = {
        name: np.zeros((episodes, segments), kind) for name, kind in DECIDED.items()
    }
    finished = np.zeros(episodes, np.int64)  # recorded decisions of each track
    unfinished = np.ones(episodes, np.bool_)
    for now in rollout(env, decider, seed, unfinished):
        decided = now.info.get("_decided_mode") if now.step else None
        if decided is None:
            continue
        new = np.flatnonzero(decided & unfinished)
        for name, array in recorded.items():
            array[new, finished[new]] = now.info[name][new]
        finished[new] += 1
        unfinished[:] = finished < segments
        on_progress(float(finished.sum()) / recorded["ticks"].size)
        if not unfinished.any():
            break
    names = [name.removeprefix("decided_") if name != "decided_mode" else name for name in recorded]
    return Decisions(**dict(zip(names, recorded.values(), strict=True)), delay_cost=env.options.delay_cost)


def check_episodes(name: str, episodes: int, options: WorldOptions) -> None:
    """Raise `ArgumentError` if the episodes would fill the memory; `name` is the argument."""
    check_integer(name, episodes, maximum=max(1, LARGEST_RESULT // options.segments))


def batch_size(options: WorldOptions) -> int:
    """Return the largest number of episodes that are run in parallel."""
    bytes_per_episode = 2500 + 2800 * options.hypotheses  # measured, with a network
    return max(1, LARGEST_BATCH // bytes_per_episode)
