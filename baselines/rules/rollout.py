"""The loop around an environment and a decider: all rollouts of the project go through it."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.rules.decider import Actions, Observations
from baselines.rules.own import Asked, as_decider
from baselines.scoring.decisions import Decisions
from baselines.scoring.statements import Statements
from hybrid_env.checks import BoolArray, FloatArray, check_integer, reject
from hybrid_env.options import WorldOptions
from hybrid_env.registration import make_track_vector_env, make_vector_env
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv

DROPPED_BELOW = 0.8  # finished tracks are no longer passed to the decider once fewer than this fraction are unfinished
LARGEST_BATCH = 700_000_000  # bytes
LARGEST_RESULT = 10_000_000  # segments, which need half a gigabyte

DECIDED = {
    "correct": np.bool_, "type_correct": np.bool_, "ticks": np.int64, "forced": np.bool_,
    "decided_true_mode": np.int64, "decided_mode": np.int64, "decided_length": np.int64,
    "decided_squared_error": np.float64,
}  # fmt: skip
"""What `info` tells of a decision."""


@dataclass
class Now:
    """The present tick of a rollout, before the decider is asked."""

    step: int  # number of steps so far
    observation: Observations  # (N, width) rows of the present tick
    seen: NDArray[Any]  # what the decider will read: the rows, or what it observes of the arrays
    state: Any  # of the decider
    starts: BoolArray  # (N,) True where an episode begins
    terminated: BoolArray  # (N,) True where the last step ended an episode
    actions: Actions  # (N,) of the last step; zeros before the first
    rewards: FloatArray  # (N,) of the last step
    info: dict[str, Any]  # of the last step or the reset


def rollout(env: Any, model: Any, seed: int, unfinished: BoolArray | None = None) -> Iterator[Now]:
    """Run a decider on an environment, without end: yield every tick before the decider is asked.

    In the body of the loop the environment is at the tick that was yielded, with the results of the last step; the
    decider is asked and the environment stepped when the loop goes on.

    Args:
        env: Gymnasium's `VectorEnv` of N tracks, with their arrays as `world`; its autoreset mode says what follows an
            episode.
        model: a decider, any object with its `predict`, or a function of the observations.
        seed: of the first track; track i has seed + i, so that deciders can be compared in pairs.
        unfinished: (N,) tracks whose actions still count, written by the body of the loop. Others are no longer passed
            to deciders that can drop tracks. Without it all count.
    """
    decider = as_decider(model)
    ask = Asked(decider, int(env.single_action_space.n))
    rows, info = env.reset(seed=seed)
    running = np.arange(env.num_envs)  # tracks passed to the decider
    drops = unfinished is not None
    actions, rewards = np.zeros(env.num_envs, np.int64), np.zeros(env.num_envs)
    starts, terminated = np.ones(env.num_envs, np.bool_), np.zeros(env.num_envs, np.bool_)
    now = Now(0, rows, rows, None, starts, terminated, actions, rewards, info)
    while True:
        now.seen = now.observation if decider.observes == "rows" else decider.observe(env.world)
        yield now
        if drops and unfinished is not None:
            left = unfinished[running]
            if np.count_nonzero(left) < DROPPED_BELOW * running.size:
                kept = decider.select_tracks(now.state, left)
                drops = kept is not NotImplemented
                if drops:
                    now.state, running = kept, running[left]
                    actions[:] = 0
        seen, starts = now.seen, now.starts
        if running.size < env.num_envs:
            seen, starts = seen[running], starts[running]
        chosen, now.state = ask(seen, now.state, starts)
        actions[running] = chosen
        now.actions = actions.copy()
        now.observation, now.rewards, now.terminated, _, now.info = env.step(actions)
        now.starts = now.terminated
        now.step += 1


def record_statements(decider: Any, tracks: int, seed: int, **options: Any) -> Statements:
    """Run a decider on one episode of every track.

    Args:
        decider: a rule or agent whose action i states mode i.
        tracks: N, number of episodes.
        seed: of the first track; track i has seed + i, so that deciders can be compared in pairs.
        options: see `hybrid_env.QuickestOptions`.
    """
    return record_together([decider], tracks, seed, **options)[0]


def record_together(deciders: Sequence[Any], tracks: int, seed: int, **options: Any) -> list[Statements]:
    """Return `record_statements` of each of some deciders of one rule, computed together if they can be."""
    make = partial(HybridTrackQuickestVectorEnv, tracks, autoreset_mode="Disabled", tick_info=False, **options)
    return record_in(make, deciders, check_integer("seed", seed, minimum=0))


def record_in(make: Callable[[], Any], deciders: Sequence[Any], seed: int) -> list[Statements]:
    """Return the statements of deciders of one rule, together if they can be, on one episode of every track.

    `make` returns the environment, whose world has the field `true_mode`; the first track has the seed.
    """
    several = type(deciders[0]).together(deciders) if len(deciders) > 1 else None
    if several is None and len(deciders) > 1:
        return [one for decider in deciders for one in record_in(make, [decider], seed)]
    decider, env = deciders[0] if several is None else several, make()
    true_modes = np.empty((env.options.ticks, env.num_envs), np.int64)
    stated_modes = np.empty((len(deciders), *true_modes.shape), np.int64)
    for now in rollout(env, decider, seed):
        if now.step:
            stated_modes[:, now.step - 1] = [now.actions] if several is None else several.chosen
        if now.step == len(true_modes):
            break
        true_modes[now.step] = env.world.field("true_mode")
    return [Statements(true_modes, stated) for stated in stated_modes]


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
        decider: a decider, any object with its `predict`, or a function of the observations.
        env_id: registered id.
        episodes: E; they run in parallel, one per track, in batches that need less than a gigabyte.
        seed: of the first episode.
        on_progress: called repeatedly with the fraction of finished segments.
        options: environment options that override those of the id.

    Raises:
        ArgumentError: the actions of the environment are not declarations of hypotheses, or the decider was trained on
            observations of another shape.

    Warns:
        UserWarning: a model of Stable-Baselines3 was trained in an environment of another id.
    """
    _check_training(decider, env_id)
    given = make_track_vector_env(env_id, 1, **options).options
    check_episodes("episodes", episodes, given)
    size, batches = batch_size(given), []
    for first in range(0, episodes, size):
        count = min(size, episodes - first)

        def show(share: float, finished: int = first, width: int = count) -> None:
            if on_progress is not None:
                on_progress((finished + width * share) / episodes)

        batches.append(evaluate_batch(decider, env_id, count, seed + first, show, options))
    names = [name for name in vars(batches[0]) if name != "delay_cost"]
    arrays = {name: np.concatenate([getattr(batch, name) for batch in batches]) for name in names}
    return Decisions(**arrays, delay_cost=given.delay_cost)


def _check_training(decider: Any, env_id: str) -> None:
    """Compare an environment with the one that a model of Stable-Baselines3 knows, where it knows one."""
    name = env_id.rpartition(":")[2]
    get_env = getattr(decider, "get_env", None)
    env = get_env() if callable(get_env) else None
    with suppress(AttributeError, NotImplementedError):
        trained = None if env is None else env.get_attr("spec")[0].id.rpartition(":")[2]
        if trained not in (None, name):
            warnings.warn(f"the model was trained in {trained} and is evaluated in {name}", stacklevel=3)


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
    width = getattr(getattr(decider, "observation_space", None), "shape", None)
    if width not in (None, env.single_observation_space.shape):
        allowed = f"one for observations of shape {env.single_observation_space.shape}"
        raise reject("observation shape of the decider", width, allowed)
    if env.options.actions != "all":
        raise reject("actions", env.options.actions, "'all': deciders declare hypotheses")
    segments = env.options.segments
    recorded: dict[str, NDArray[Any]] = {name: np.zeros((episodes, segments), kind) for name, kind in DECIDED.items()}
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
