"""Laws of durations with their probabilities, among which a beam learns that of an object."""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from baselines.rules.beam_habits import SMALLEST_BELIEF
from hybrid_env.checks import Float32Array, FloatArray
from hybrid_env.durations import (
    DurationLaw,
    GeometricDurations,
    UniformDurations,
    duration_probabilities,
    remaining_probabilities,
)


class Prior(NamedTuple):
    """Laws of the durations, with numbers in proportion to their probabilities."""

    # L laws.
    laws: tuple[DurationLaw, ...]
    # L numbers in proportion to their probabilities.
    weights: tuple[float, ...]
    # Probability that straight motion and turns have laws of their own.
    different: float = 0.05
    # Probability that the next modes are not equally likely.
    habitual: float = 0.2
    # Smallest and largest hazard, so that no duration excludes a law.
    floor: float = 0.0
    # Smallest and largest hazard.
    ceiling: float = 1.0


@functools.cache
def mixed_prior(
    widths: Sequence[tuple[float, float]] = (
        (1.06, 0.04),
        (1.13, 0.07),
        (1.3, 0.15),
        (1.7, 0.3),
        (2.5, 0.5),
    ),
    shortest: tuple[float, float] = (10.2, 400.0),
    offsets: Sequence[int] = (0, 5, 10, 20, 40, 80, 160),
    means: Sequence[int] = (10, 20, 40, 80, 160),
    shares: tuple[float, float] = (0.4, 0.1),
    known: Sequence[tuple[DurationLaw, float]] = ((GeometricDurations(50.0, 25), 0.5),),
) -> Prior:
    """Return uniform laws, geometric ones, and some single ones; by default the law of the
    environment.

    Args:
        widths: longest over shortest duration of the uniform laws, and the distance of the
            logarithms of the shortest.
        shortest: range of the shortest durations [ticks].
        offsets, means: of the geometric laws, in all combinations.
        shares: probabilities of the uniform and of the geometric laws.
        known: the single laws with their probabilities.
    """
    laws: list[GeometricDurations | UniformDurations] = []
    weights: list[float] = []
    low, high = np.log(shortest)
    for width, step in widths:
        first = np.unique(np.exp(np.arange(low, high, step)).round().astype(int))
        laws += [UniformDurations(k, max(round(width * k), k + 1)) for k in first.tolist()]
        weights += [1.0 / len(first)] * len(first)
    geometric = [GeometricDurations(float(mean), offset) for offset in offsets for mean in means]
    average = np.log([law.mean_duration for law in (*laws, *geometric)])
    # The median mean duration of both kinds is 70 ticks; the deviation of its logarithm is .6.
    likely = np.append(weights, np.ones(len(geometric))) * np.exp(
        -0.5 * ((average - np.log(70.0)) / 0.6) ** 2
    )
    kinds = np.split(likely, [len(laws)])
    parts = [share * kind / kind.sum() for share, kind in zip(shares, kinds, strict=True)]
    single, probabilities = zip(*known, strict=True)
    return Prior(
        (*laws, *geometric, *single),
        (*np.concatenate(parts).tolist(), *probabilities),
        floor=2e-4,
        ceiling=0.4,
    )


def hazards(laws: FloatArray) -> FloatArray:
    """Return the probability that a segment ends after each age, (rows, ticks), of laws as
    `QuickestOptions.duration_laws`.
    """
    table = np.empty_like(laws)
    for row, ends in enumerate(laws):
        before = 1.0 - np.append(0.0, np.cumsum(ends)[:-1])
        reached = int(np.argmin(before > 1e-12)) or len(ends)
        table[row, :reached] = ends[:reached] / before[:reached]
        # Ages that are hardly ever or never reached have the hazard before them.
        table[row, reached:] = table[row, reached - 1]
    return table.clip(0.0, 1.0)


@functools.lru_cache(4)
def hazard_tables(prior: Prior, ages: int, random_start: bool) -> Float32Array:
    """Return the tables of `beam_filters.BeamModel`, (2, ages, 2, L), which all thresholds
    share.
    """
    first = remaining_probabilities if random_start else duration_probabilities
    tables = np.empty((2, ages, 2, len(prior.laws)))
    for row, probabilities in enumerate((first, duration_probabilities)):
        laws = np.stack([probabilities(law, ages) for law in prior.laws])
        ends = hazards(laws).T.clip(prior.floor, prior.ceiling)
        tables[row, :, 0] = np.cumprod(np.vstack([np.ones(len(laws)), 1.0 - ends[:-1]]), axis=0)
        tables[row, :, 1] = tables[row, :, 0] * ends
    return np.where(tables > SMALLEST_BELIEF, tables, 0.0).astype(np.float32)
