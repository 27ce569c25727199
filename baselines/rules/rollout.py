"""The loop around an environment and a decider: all rollouts of the project go through it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from baselines.rules.decider import ANNOUNCED, Actions, Observations
from baselines.rules.external import ModelDecider, as_decider, ask, observed
from baselines.scoring.decisions import Decisions
from baselines.scoring.statements import Statements
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, Info, check_integer
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import make_vector_env
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv
from hybrid_env.wrappers import NO_DECISION


@dataclass
class Tick:
    """The present tick of a rollout, before the decider is asked."""

    # Number of steps so far.
    step: int
    # (N, width) rows of the present tick.
    observation: Observations
    # What the decider will read: the rows, or what it observes of the arrays.
    seen: AnyArray
    # The memory of the decider.
    state: Any
    # (N,) True where an episode begins.
    starts: BoolArray
    # (N,) True where the last step ended an episode.
    terminated: BoolArray
    # (N,) of the last step, at several thresholds (K, N); zeros before the first.
    actions: Actions
    # (N,) of the last step.
    rewards: FloatArray
    # What the last step or the reset told.
    info: Info


def rollout(
    env: Any, model: Any, seed: int, unfinished: BoolArray | None = None, decide_every: int = 1
) -> Iterator[Tick]:
    """Run a decider on an environment, without end: yield every tick before the decider is asked.

    The decider is asked and the environment stepped when the loop goes on.

    Args:
        env: Gymnasium's `VectorEnv` of N tracks, with their arrays as `world`; its autoreset mode
            says what follows an episode.
        model: a decider, any object with its `predict`, or a function of the observations.
        seed: of the first track; track i has seed + i, so that deciders can be compared in pairs.
        unfinished: (N,) tracks whose actions still count, written by the body of the loop. Others
            are no longer passed to deciders that can drop tracks. Without it all count.
        decide_every: ticks between decisions, on an environment that asks at every tick. A decider
            that reads every row is asked all the same; its other actions have no effect.
    """
    decider = as_decider(model).for_modes(env.options)
    waits = env.options.switches == ANNOUNCED
    tracks = env.num_envs
    action_count = int(env.single_action_space.n)
    # Tracks passed to the decider.
    running = np.arange(tracks)
    rows, info = env.reset(seed=seed)
    actions = np.zeros(tracks, int)
    starts = np.ones(tracks, bool)
    terminated = np.zeros(tracks, bool)
    now = Tick(0, rows, rows, None, starts, terminated, actions, np.zeros(tracks), info)
    while True:
        now.seen = now.observation if decider.observes == "rows" else observed(decider, env.world)
        yield now
        if unfinished is not None:
            left = unfinished[running]
            # Finished tracks are no longer passed to the decider once they are a fifth.
            if np.count_nonzero(left) < 0.8 * running.size:
                kept = decider.select_tracks(now.state, left)
                if kept is NotImplemented:
                    unfinished = None
                else:
                    now.state = kept
                    running = running[left]
                    actions[:] = 0
        seen = now.seen
        starts = now.starts
        if running.size < tracks:
            seen = seen[running]
            starts = starts[running]
        counts = decision_ticks(env, decide_every)[running]
        answer = now.actions[..., running] * (not waits)
        if decider.every_tick or counts.any():
            asked, now.state = ask(decider, action_count, seen, now.state, starts)
            answer = np.where(counts, asked, answer)
        # With several thresholds the environment follows the first one.
        actions[running] = answer[0] if answer.ndim == 2 else answer
        now.actions = answer if answer.ndim == 2 else actions.copy()
        now.observation, now.rewards, now.terminated, _, now.info = env.step(actions)
        now.starts = now.terminated
        now.step += 1


def decision_ticks(env: Any, decide_every: int) -> BoolArray:
    """Return whether the present tick of each track is one for a decision, (N,)."""
    if decide_every == 1:
        return np.ones(env.num_envs, bool)
    if env.options.switches != ANNOUNCED:
        return (env.world.field("time") - 1) % decide_every == 0
    ticks = env.world.field("tick")
    return (ticks % decide_every == 0) | (ticks == env.world.field("length"))


def statement_env(options: QuickestOptions, tracks: int) -> HybridTrackQuickestVectorEnv:
    """Return N tracks of one episode each, in which modes are stated at every tick."""
    return HybridTrackQuickestVectorEnv(
        tracks, autoreset_mode="Disabled", tick_info=False, **{**vars(options), "decide_every": 1}
    )


def record_statements(decider: Any, tracks: int, seed: int, **options: Any) -> Statements:
    """Run a decider, whose action i states mode i, on one episode of each of N tracks.

    Args:
        decider, tracks, options: a rule or agent; N; see `hybrid_env.QuickestOptions`.
        seed: of the first track; track i has seed + i, so that deciders can be compared in pairs.
    """
    given = QuickestOptions(**options)
    make = partial(statement_env, given, tracks)
    first = check_integer("seed", seed, minimum=0)
    return record_in(make, decider, first, decide_every=given.decide_every)[0]


def record_in(
    make: Callable[[], Any],
    decider: Any,
    seed: int,
    thresholds: Sequence[float] | None = None,
    decide_every: int = 1,
) -> list[Statements]:
    """Return the statements of a decider at some thresholds, or at its own, as
    `record_statements`.

    The environment is what `make` returns; it asks at every tick, and its world has the field
    `true_mode`. A statement holds for `decide_every` ticks.
    """
    if thresholds is not None:
        at_once = decider.sweeps and len(thresholds) > 1
        deciders = [decider.at(thresholds)] if at_once else map(decider.at, thresholds)
        return [
            statements
            for each in deciders
            for statements in record_in(make, each, seed, decide_every=decide_every)
        ]
    env = make()
    decider = as_decider(decider)
    true_modes = np.empty((env.options.ticks, env.num_envs), int)
    stated_modes = np.empty((np.size(decider.threshold), *true_modes.shape), int)
    for now in rollout(env, decider, seed, decide_every=decide_every):
        if now.step:
            stated_modes[:, now.step - 1] = now.actions
        if now.step == len(true_modes):
            break
        true_modes[now.step] = env.world.field("true_mode")
    return [Statements(true_modes, stated) for stated in stated_modes]


def record_decisions(
    decider: Any,
    env_id: str = "hybrid_env:HybridTrack-v0",
    episodes: int = 1000,
    seed: int = 0,
    on_progress: Callable[[float], None] = lambda share: None,
    **options: Any,
) -> Decisions:
    """Run a decider on the episodes with seeds seed, seed + 1, ..., each exactly once.

    All deciders face the same episodes: trajectories and noise do not depend on the decisions. They
    run in parallel, one per track; a gigabyte of memory is enough for 60,000 of them with three
    hypotheses.

    Args:
        decider: a decider, any object with its `predict`, or a function of the observations.
        env_id, options: registered id, and environment options that override its own.
        episodes, seed: number E, and seed of the first one.
        on_progress: called with the share of decided segments.
    """
    check_integer("episodes", episodes)
    given = make_vector_env(env_id, 1, **options)
    model = decider.model if isinstance(decider, ModelDecider) else decider
    # A model of a learning library plays with the actions that it was trained with; all others
    # declare hypotheses.
    trained = getattr(model, "action_space", None) == given.single_action_space
    every = given.options.decide_every
    if as_decider(decider).every_tick:
        options = options | {"decide_every": 1}
    env = make_vector_env(
        env_id, episodes, **(options if trained else options | {"actions": "all"})
    )
    # Between decisions that the environment does not ask for.
    every = every if env.options.decide_every < every else 1
    segments = env.options.segments
    recorded = {name: np.full((episodes, segments), value) for name, value in NO_DECISION.items()}
    # Decisions of each track so far.
    finished = np.zeros(episodes, int)
    unfinished = np.ones(episodes, bool)
    for now in rollout(env, decider, seed, unfinished, every):
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
    decided_mode = recorded.pop("decided_mode")
    return Decisions(
        decided_mode=decided_mode,
        **{name.removeprefix("decided_"): array for name, array in recorded.items()},
        reward=env.options.segment_reward(recorded["correct"], recorded["ticks"]),
    )


def batch_size(options: WorldOptions) -> int:
    """Return the largest number of episodes that are run in parallel."""
    # Bytes of all episodes, and of one with a network.
    return max(1, 700_000_000 // (2500 + 2800 * options.hypotheses))
