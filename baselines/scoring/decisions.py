"""Decisions for announced switches, and values of every episode."""

from collections.abc import Callable
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
    def values(self) -> FloatArray:
        """Values of each episode, (E, F), see `EPISODE_VALUES`."""
        return np.stack([value(self) for value in EPISODE_VALUES.values()], axis=1)


# Values of each episode by name, (E,) each: means over its segments, then sums.
EPISODE_VALUES: dict[str, Callable[[Decisions], FloatArray]] = {
    "accuracy": lambda decisions: decisions.correct.mean(1),
    "type_accuracy": lambda decisions: decisions.type_correct.mean(1),
    "ticks": lambda decisions: decisions.ticks.mean(1),
    "reward": lambda decisions: decisions.reward.mean(1),
    "forced": lambda decisions: decisions.forced.mean(1),
    "squared_error": lambda decisions: decisions.squared_error.sum(1),
    "length": lambda decisions: decisions.length.sum(1),
    "wrong_after_correct": lambda decisions: (
        ~decisions.correct[:, 1:] & decisions.correct[:, :-1]
    ).sum(1),
    "after_correct": lambda decisions: decisions.correct[:, :-1].sum(1),
    "wrong_after_wrong": lambda decisions: (
        ~decisions.correct[:, 1:] & ~decisions.correct[:, :-1]
    ).sum(1),
    "after_wrong": lambda decisions: (~decisions.correct[:, :-1]).sum(1),
}
COLUMNS = tuple(EPISODE_VALUES)
"""Names of the values of an episode."""
