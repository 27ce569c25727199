"""The beam that learns the rhythm of an object: the law of its durations and the order of its
modes.
"""

import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.rules.beam import BeamDecider, hazards
from baselines.rules.beam_habits import SMALLEST
from hybrid_env.durations import (
    GeometricDurations,
    SimpleDurations,
    UniformDurations,
    duration_probabilities,
    remaining_probabilities,
)
from hybrid_env.quickest_options import QuickestOptions

# Ticks, of the shortest duration of a uniform law of the prior.
SHORTEST, LONGEST = 10.2, 400.0
# Longest over shortest duration of the uniform laws, and the distance of the logarithms of the
# shortest.
WIDTHS = {
    1.06: 0.04,
    1.13: 0.07,
    1.3: 0.15,
    1.7: 0.3,
    2.5: 0.5,
}
# Of the geometric laws.
OFFSETS, MEANS = (0, 5, 10, 20, 40, 80, 160), (10, 20, 40, 80, 160)
# Probability of each kind, and of the environment's default law.
UNIFORM, GEOMETRIC, DEFAULT = 0.4, 0.1, 0.5
# Median mean duration [ticks] of both kinds, and deviation of its logarithm.
USUAL, SPREAD = 70.0, 0.6
# Probability that straight motion and turns have laws of their own.
DIFFERENT = 0.05
# Probability that the next modes are not equally likely.
HABITUAL = 0.2
# Of the hazards, so that no duration excludes a law.
FLOOR, CEILING = 2e-4, 0.4
# Ticks, largest age of the tables.
OLDEST = 1200


class Prior(NamedTuple):
    """Laws of the durations, with numbers in proportion to their probabilities."""

    # L laws.
    laws: tuple[SimpleDurations, ...]
    # L numbers in proportion to their probabilities.
    weights: tuple[float, ...]
    # Probability that straight motion and turns have laws of their own.
    different: float = DIFFERENT
    # Probability that the next modes are not equally likely.
    habitual: float = HABITUAL
    # Smallest and largest hazard.
    floor: float = 0.0
    # Smallest and largest hazard.
    ceiling: float = 1.0


def mixed_prior(
    widths: dict[float, float],
    shortest: tuple[float, float],
    offsets: Sequence[int],
    means: Sequence[int],
    shares: tuple[float, float],
    known: Mapping[SimpleDurations, float],
    different: float,
    habitual: float,
) -> Prior:
    """Return uniform laws, geometric ones, and some single ones.

    Args:
        widths: longest over shortest duration of the uniform laws, and the distance of the
            logarithms of the shortest.
        shortest: range of the shortest durations [ticks].
        offsets, means: of the geometric laws, in all combinations.
        shares: probabilities of the uniform and of the geometric laws.
        known: the single laws with their probabilities.
        different, habitual: see `Prior`.
    """
    laws: list[GeometricDurations | UniformDurations] = []
    weights: list[float] = []
    low, high = np.log(shortest)
    for width, step in widths.items():
        first = np.unique(np.exp(np.arange(low, high, step)).round().astype(int))
        laws += [UniformDurations(k, max(round(width * k), k + 1)) for k in first.tolist()]
        weights += [1.0 / len(first)] * len(first)
    geometric = [GeometricDurations(float(mean), offset) for offset in offsets for mean in means]
    average = np.log([law.mean_duration for law in (*laws, *geometric)])
    usual = np.append(weights, np.ones(len(geometric))) * np.exp(
        -0.5 * ((average - np.log(USUAL)) / SPREAD) ** 2
    )
    kinds = np.split(usual, [len(laws)])
    parts = [share * kind / kind.sum() for share, kind in zip(shares, kinds, strict=True)]
    everything = (*laws, *geometric, *known)
    return Prior(
        everything,
        (*np.concatenate(parts).tolist(), *known.values()),
        different,
        habitual,
        FLOOR,
        CEILING,
    )


@functools.cache
def default_prior() -> Prior:
    """Return uniform laws of five relative widths, geometric ones, and the default law of the
    environment.
    """
    known: dict[SimpleDurations, float] = {GeometricDurations(50.0, 25): DEFAULT}
    shares = UNIFORM, GEOMETRIC
    return mixed_prior(
        WIDTHS,
        (SHORTEST, LONGEST),
        OFFSETS,
        MEANS,
        shares,
        known,
        DIFFERENT,
        HABITUAL,
    )


class AdaptiveBeamDecider(BeamDecider):
    """The beam averaged over laws of durations by their evidence, with the order of the modes by
    counts.

    It is told neither. Histories carry beliefs, see `beam_habits`; the filters are those of one
    beam. Arguments as for `BeamDecider`, and laws with their probabilities; None is
    `default_prior`.
    """

    name = "beam-adaptive"
    title = "beam, adaptive"
    default = 0.65
    informed = False
    colour = "#0f961e"
    marker = "8"

    def __init__(
        self,
        options: QuickestOptions,
        threshold: float = 0.65,
        *,
        prior: Prior | None = None,
        **others: Any,
    ):
        super().__init__(options, threshold, **others)
        known = default_prior() if prior is None else prior
        # Of the rows of `beam_habits.Habits`.
        shares = 1.0 - known.different, known.different, known.different
        self.model = self.model._replace(
            tables=_tables(known, min(options.ticks, OLDEST), options.start == "random"),
            prior=np.outer(shares, known.weights) / np.sum(known.weights),
            habitual=known.habitual,
        )


@functools.lru_cache(4)
def _tables(prior: Prior, ages: int, random_start: bool) -> NDArray[np.float32]:
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
    return np.where(tables > SMALLEST, tables, 0.0).astype(np.float32)
