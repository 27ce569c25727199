"""Simulated paths of the posterior within segments without an early decision, and its
calibration.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from baselines.rules.decider import Actions, Observations, RowRule
from baselines.rules.msprt import mode_types, read_error_probability, rewarded
from baselines.rules.rollout import rollout
from hybrid_env.checks import BoolArray, FloatArray, IntArray, check_integer, reject
from hybrid_env.options import WorldOptions
from hybrid_env.vector_env import HybridTrackVectorEnv

# Of the calibration, of the stated probability.
BIN_EDGES = (0.0, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)
# Smaller bins are ignored: their accuracy has a standard error of up to 1.6 percentage points.
MIN_COUNT = 1000


@dataclass(frozen=True)
class PosteriorPaths:
    """Error probabilities of S segments over up to T ticks, when nobody decides before the end."""

    # (S, T) natural logarithms of the error probability of the best declaration.
    log_error_probability: FloatArray
    # (S, T) whether that declaration would have been correct.
    correct: BoolArray
    # (S,) number of recorded ticks; later entries are meaningless.
    length: IntArray


class Never(RowRule):
    """Waits at every tick, or states straight motion."""

    def act(self, rows: Observations) -> Actions:
        """See `RowRule.act`."""
        return np.zeros(len(rows), np.int64)


def simulate_posterior_paths(
    episodes: int,
    seed: int,
    ticks: int | None = None,
    **options: Any,
) -> PosteriorPaths:
    """Simulate episodes with seeds seed, seed + 1, ..., in which every segment is decided at its
    end, so that most anchors are accurate; options as of `hybrid_env.WorldOptions`. Up to `ticks`
    of each segment are recorded.
    """
    check_integer("seed", seed, minimum=0)
    world = WorldOptions.of(**options | {"undecided": "likeliest"})
    env = HybridTrackVectorEnv(check_integer("episodes", episodes), tick_info=False, **vars(world))
    last = (
        world.longest_segment
        if ticks is None
        else min(check_integer("ticks", ticks), world.longest_segment)
    )
    by = rewarded(world)
    kind = mode_types(world.hypotheses) if by == "type" else np.arange(world.hypotheses)
    shape = (episodes * world.segments, last)
    log_error_probability = np.zeros(shape)
    correct = np.zeros(shape, np.bool_)
    length = np.zeros(shape[0], np.int64)
    running = np.ones(episodes, np.bool_)
    first = np.arange(episodes) * world.segments
    for now in rollout(env, Never(), seed):
        running &= ~(now.terminated & (now.step > 0))
        if not running.any():
            break
        tick = env.world.field("tick")
        recorded = running & (tick <= last)
        rows, tick = (first + env.world.field("segment"))[recorded], tick[recorded]
        value, best = read_error_probability(now.observation, by)
        log_error_probability[rows, tick - 1] = value[recorded]
        correct[rows, tick - 1] = (kind[best] == kind[env.world.field("true_mode")])[recorded]
        length[rows] = tick
    return PosteriorPaths(log_error_probability, correct, length)


@dataclass(frozen=True)
class Calibration:
    """Stated probability and accuracy of the best declaration, in B bins of the stated
    probability.
    """

    # (B,) mean stated probability, 0 in an empty bin.
    stated: FloatArray
    # (B,) share of correct declarations, 0 in an empty bin.
    accuracy: FloatArray
    # (B,) number of segments.
    count: IntArray
    # Over all segments.
    mean_stated: float
    mean_accuracy: float

    @property
    def worst(self) -> float:
        """Largest `stated` minus `accuracy` of a bin with at least `MIN_COUNT` segments; NaN
        without one.
        """
        gaps = (self.stated - self.accuracy)[self.count >= MIN_COUNT]
        return float(gaps[np.abs(gaps).argmax()]) if gaps.size else float("nan")


def calibration(paths: PosteriorPaths, tick: int) -> Calibration:
    """Return the calibration of the posterior at a tick, over the segments that reach it."""
    if check_integer("tick", tick) > paths.length.max():
        raise reject("tick", tick, f"at most {paths.length.max()}, the longest of the segments")
    reached = paths.length >= tick
    error = np.exp(paths.log_error_probability[reached, tick - 1])
    stated = 1.0 - error
    correct = paths.correct[reached, tick - 1]
    bins = np.clip(np.digitize(stated, BIN_EDGES) - 1, 0, len(BIN_EDGES) - 2)
    count = np.bincount(bins, minlength=len(BIN_EDGES) - 1)
    total = np.maximum(count, 1)
    mean, accuracy = (
        np.bincount(bins, values, minlength=count.size) / total for values in (stated, correct)
    )
    return Calibration(mean, accuracy, count, float(1.0 - error.mean()), float(correct.mean()))
