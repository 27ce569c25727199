"""Decisions for announced switches, and figures of every episode."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from baselines.scoring.scores import Statistic, quotient, ratio
from hybrid_env.checks import BoolArray, FloatArray, IntArray

RMSE = Statistic(("squared_error", "length"), lambda error, length: np.sqrt(quotient(error, length)))
ERROR_AFTER = {
    "correct": ratio("wrong_after_correct", "after_correct"),
    "wrong": ratio("wrong_after_wrong", "after_wrong"),
}
"""Error rates after a correct and after a wrong decision in the episode."""


@dataclass(frozen=True)
class Decisions:
    """All decisions in E episodes with K segments each, as arrays of shape (E, K)."""

    correct: BoolArray  # as defined by the reward, exactly or by type
    type_correct: BoolArray  # the type (straight, left or right) is correct
    ticks: IntArray  # decision time within the segment
    forced: BoolArray  # the segment ended without a declaration
    true_mode: IntArray  # index into the bank
    decided_mode: IntArray
    length: IntArray  # of the segment, in ticks
    squared_error: FloatArray  # of the estimated position, summed over the segment [m^2]
    delay_cost: float  # per tick

    @cached_property
    def reward(self) -> FloatArray:
        """Reward of each segment, (E, K)."""
        return np.where(self.correct, 1.0, -1.0) - self.delay_cost * self.ticks

    @property
    def figures(self) -> FloatArray:
        """Figures of each episode, (E, 11), see `COLUMNS`."""
        previous, wrong = self.correct[:, :-1], ~self.correct[:, 1:]
        shares = [one.mean(1) for one in (self.correct, self.type_correct, self.ticks, self.reward, self.forced)]
        sums = [self.squared_error.sum(1), self.length.sum(1)]
        after = [(wrong & previous).sum(1), previous.sum(1), (wrong & ~previous).sum(1), (~previous).sum(1)]
        return np.stack([*shares, *sums, *after], axis=1)


COLUMNS = (
    "accuracy", "type_accuracy", "ticks", "reward", "forced", "squared_error", "length",
    "wrong_after_correct", "after_correct", "wrong_after_wrong", "after_wrong",
)  # fmt: skip
"""Figures of an episode: means over its segments, then sums."""
