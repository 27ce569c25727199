"""Statements of a decider on fixed episodes with unknown switches."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from baselines.rules.rollout import rollout
from baselines.scoring.statements import Statements
from hybrid_env.checks import check_integer
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv


def record_statements(decider: Any, tracks: int, seed: int, **options: Any) -> Statements:
    """Run a decider on one episode of every track.

    Args:
        decider: a rule or agent whose action i states mode i.
        tracks: N, number of episodes.
        seed: of the first track; track i has seed + i, so that deciders can be compared in pairs.
        options: see `hybrid_env.QuickestOptions`.

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """
    return record_together([decider], tracks, seed, **options)[0]


def record_together(deciders: Sequence[Any], tracks: int, seed: int, **options: Any) -> list[Statements]:
    """Return `record_statements` of each of some deciders of one rule, computed together if they can be."""
    several = type(deciders[0]).together(deciders) if len(deciders) > 1 else None
    if several is None and len(deciders) > 1:
        return [record_statements(decider, tracks, seed, **options) for decider in deciders]
    decider = deciders[0] if several is None else several
    env = HybridTrackQuickestVectorEnv(tracks, autoreset_mode="Disabled", tick_info=False, **options)
    true_modes = np.empty((env.options.ticks, tracks), np.int64)
    stated_modes = np.empty((len(deciders), *true_modes.shape), np.int64)
    for now in rollout(env, decider, check_integer("seed", seed, minimum=0)):
        if now.step:
            chosen = [now.actions] if several is None else several.chosen
            stated_modes[:, now.step - 1] = chosen
        if now.step == len(true_modes):
            break
        true_modes[now.step] = env.world.field("true_mode")
    return [Statements(true_modes, stated) for stated in stated_modes]
