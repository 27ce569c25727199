"""Decisions for announced switches, and values of every episode."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hybrid_env.checks import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Decisions:
    """All decisions in E episodes with K segments each, as arrays of shape (E, K)."""

    # Names of the values of an episode.
    columns: ClassVar = (
        *("accuracy", "type_accuracy", "ticks", "reward", "forced"),
        *("squared_error", "length"),
    )

    # As defined by the reward, exactly or by type.
    correct: BoolArray
    # The type (straight, left or right) is correct.
    type_correct: BoolArray
    # Decision time within the segment.
    ticks: IntArray
    # The segment ended without a declaration.
    forced: BoolArray
    # Index into the bank.
    true_mode: IntArray
    decided_mode: IntArray
    # Ticks of the segment.
    length: IntArray
    # Squared error of the estimated position, summed over the segment [m^2].
    squared_error: FloatArray
    # Reward of the segment, see `WorldOptions.segment_reward`.
    reward: FloatArray

    @property
    def values(self) -> FloatArray:
        """Values of each episode, (E, F), see `columns`: means over its segments, then sums."""
        means = self.correct, self.type_correct, self.ticks, self.reward, self.forced
        columns = (*(each.mean(1) for each in means), self.squared_error.sum(1), self.length.sum(1))
        return np.stack(columns, axis=1)
