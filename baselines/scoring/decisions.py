"""Decisions for announced switches, and figures of every episode."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from baselines.scoring.scores import Statistic, quotient, ratio
from hybrid_env.checks import BoolArray, FloatArray, IntArray

RMSE = Statistic(
    ("squared_error", "length"),
    lambda error, length: np.sqrt(quotient(error, length)),
)
ERROR_AFTER = {
    "correct": ratio("wrong_after_correct", "after_correct"),
    "wrong": ratio("wrong_after_wrong", "after_wrong"),
}
"""Error rates after a correct and after a wrong decision in the episode."""


@dataclass(frozen=True)
class Decisions:
    """All decisions in E episodes with K segments each, as arrays of shape (E, K)."""

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
    # Of the segment, in ticks.
    length: IntArray
    # Of the estimated position, summed over the segment [m^2].
    squared_error: FloatArray
    # Per tick.
    delay_cost: float

    @cached_property
    def reward(self) -> FloatArray:
        """Reward of each segment, (E, K)."""
        return np.where(self.correct, 1.0, -1.0) - self.delay_cost * self.ticks

    @property
    def figures(self) -> FloatArray:
        """Figures of each episode, (E, 11), see `COLUMNS`."""
        previous = self.correct[:, :-1]
        wrong = ~self.correct[:, 1:]
        shares = [
            one.mean(1)
            for one in (self.correct, self.type_correct, self.ticks, self.reward, self.forced)
        ]
        sums = [self.squared_error.sum(1), self.length.sum(1)]
        after = [
            (wrong & previous).sum(1),
            previous.sum(1),
            (wrong & ~previous).sum(1),
            (~previous).sum(1),
        ]
        return np.stack([*shares, *sums, *after], axis=1)


COLUMNS = (
    "accuracy",
    "type_accuracy",
    "ticks",
    "reward",
    "forced",
    "squared_error",
    "length",
    "wrong_after_correct",
    "after_correct",
    "wrong_after_wrong",
    "after_wrong",
)
"""Figures of an episode: means over its segments, then sums."""
