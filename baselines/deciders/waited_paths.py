"""Segments that are waited out: what a bank says after every tick, and whether it is right."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from baselines.deciders.msprt import mode_types, read_error_probability
from hybrid_env.checks import check_integer, reject
from hybrid_env.options import WorldOptions
from hybrid_env.vector_env import HybridTrackVectorEnv

FloatArray = NDArray[np.float64]
BIN_EDGES = (0.0, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)  # of a stated probability
LEAST_COUNT = 1000  # the share of right ones among fewer is known to no better than 1.5 points


@dataclass(frozen=True)
class Paths:
    """Segments that were waited out, for a stopping rule to be fitted on.

    Attributes:
        doubt: (S, T) log of the stated probability of being wrong at each tick.
        right: (S, T) whether a declaration would have been right.
        length: (S,) ticks noted; what lies behind is meaningless.
        by: what must be right.
    """

    doubt: FloatArray
    right: NDArray[np.bool_]
    length: NDArray[np.int64]
    by: Literal["hypothesis", "type"]


def waited_paths(episodes: int, seed: int, ticks: int | None = None, **options: Any) -> Paths:
    """Wait through episodes of a world; each segment is decided at its end, so anchors are mostly good.

    Args:
        episodes: at once, seeded seed, seed + 1, ...
        ticks: of each segment that are noted, None for all.
        options: of the world, see `hybrid_env.WorldOptions`; `undecided` is "likeliest" here.
    """
    check_integer("seed", seed, minimum=0)
    world = WorldOptions.of(**options | {"undecided": "likeliest"})
    env = HybridTrackVectorEnv(check_integer("episodes", episodes), tick_info=False, **vars(world))
    last = (
        world.longest_segment if ticks is None else min(check_integer("ticks", ticks), world.longest_segment)
    )
    by: Literal["hypothesis", "type"] = "type" if world.correctness == "type" else "hypothesis"
    n = len(world.radii)
    kind = mode_types(2 * n + 1) if by == "type" else np.arange(2 * n + 1)
    shape = (episodes * world.segments, last)
    doubt, right, length = np.zeros(shape), np.zeros(shape, np.bool_), np.zeros(shape[0], np.int64)
    observation, _ = env.reset(seed=seed)
    wait = np.zeros(episodes, np.int64)
    going = np.ones(episodes, np.bool_)
    first = np.arange(episodes) * world.segments
    while going.any():
        rows = first + env.world.field("segment")
        tick = env.world.field("tick")
        value, best = read_error_probability(observation, by)
        good = kind[best] == kind[env.world.field("true_mode")]
        noted = going & (tick <= last)
        doubt[rows[noted], tick[noted] - 1] = value[noted]
        right[rows[noted], tick[noted] - 1] = good[noted]
        length[rows[noted]] = tick[noted]
        observation, _, terminated, _, _ = env.step(wait)
        going &= ~terminated
    return Paths(doubt, right, length, by)


@dataclass(frozen=True)
class Calibration:
    """Stated against actual probability of being right, by bins of what was stated.

    Attributes:
        stated, actual: (B,) means over each bin.
        count: (B,) segments in it.
    """

    stated: FloatArray
    actual: FloatArray
    count: NDArray[np.int64]

    @property
    def worst(self) -> float:
        """The stated less the actual probability where they differ most, of bins with enough in them."""
        enough = self.count >= LEAST_COUNT
        gap = (self.stated - self.actual)[enough]
        return float(gap[np.abs(gap).argmax()]) if enough.any() else float("nan")


def _with_tick(paths: Paths, tick: int) -> NDArray[np.bool_]:
    """(S,) the segments that have a tick."""
    if check_integer("tick", tick) > paths.length.max():
        raise reject("tick", tick, f"at most {paths.length.max()}, the longest of the segments")
    return np.asarray(paths.length >= tick)


def calibration(paths: Paths, tick: int) -> Calibration:
    """Calibration of the likeliest hypothesis, or type, after some ticks of each segment that has them."""
    long_enough = _with_tick(paths, tick)
    stated = 1.0 - np.exp(paths.doubt[long_enough, tick - 1])
    right = paths.right[long_enough, tick - 1]
    bins = np.clip(np.digitize(stated, BIN_EDGES) - 1, 0, len(BIN_EDGES) - 2)
    count = np.bincount(bins, minlength=len(BIN_EDGES) - 1)
    total = np.maximum(count, 1)
    return Calibration(
        np.bincount(bins, stated, minlength=count.size) / total,
        np.bincount(bins, right, minlength=count.size) / total,
        count,
    )


@dataclass(frozen=True)
class Statement:
    """What a bank says after some ticks.

    Attributes:
        right: share of segments in which the likeliest hypothesis, or type, is right.
        stated: its mean posterior.
        worst: see `Calibration.worst`.
    """

    right: float
    stated: float
    worst: float


def at_tick(paths: Paths, tick: int) -> Statement:
    """The bank's statement after some ticks, over the segments that have them."""
    long_enough = _with_tick(paths, tick)
    return Statement(
        float(paths.right[long_enough, tick - 1].mean()),
        float(1.0 - np.exp(paths.doubt[long_enough, tick - 1]).mean()),
        calibration(paths, tick).worst,
    )
