"""The learning curve: periodic evaluation of an agent during training, on episodes reserved for it."""

import functools
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

from agents.evaluation.deciders import ATE, DeciderFamily
from agents.evaluation.evaluate import evaluate
from agents.evaluation.operating_curve import REWARD, sweep
from baselines.rules import seeds

EPISODES = 200
REWARD_KEY = "evaluation/reward"
FIRST_EVALUATION = 100_000  # environment steps, 2 to 5 s of training
EVALUATION_SPACING = 1.4  # ratio of the steps of consecutive evaluations


class LearningCurve(ABC):
    """Evaluates an agent at its default threshold, at geometrically spaced steps, next to a classical rule.

    The rule has its best threshold, chosen on the same episodes.

    Args:
        env_id: registered id.
        options: environment options that override those of the id.
    """

    reference_key: ClassVar[str]
    """Key of the reward of the classical rule in the metrics."""
    reference_name: ClassVar[str]
    """Name of the classical rule in figures."""
    reference: ClassVar[str]
    """The classical rule in a sentence."""
    unit: ClassVar[str]
    """What a mean reward is the mean of."""

    def __init__(self, env_id: str, options: dict[str, Any]):
        self.env_id, self.options = env_id, options
        self._next = float(FIRST_EVALUATION)

    @functools.cached_property
    def reference_reward(self) -> float:
        """Mean reward of the classical rule at its best threshold, on the same episodes."""
        return self._reference_reward()

    @abstractmethod
    def _reference_reward(self) -> float: ...

    @abstractmethod
    def _measure(self, family: DeciderFamily) -> dict[str, float]:
        """Return metrics of the agent, with its mean reward under `REWARD_KEY`."""

    @abstractmethod
    def describe(self, point: dict[str, Any]) -> str:
        """Return the metrics of a point of the curve, without the reward, as text."""

    def due(self, steps: int) -> bool:
        """Return whether an evaluation is due after a number of environment steps."""
        return steps >= self._next

    def skip(self, steps: int) -> None:
        """Skip the evaluations that were due up to a number of environment steps."""
        while self._next <= steps:
            self._next *= EVALUATION_SPACING

    def evaluate(self, family: DeciderFamily, steps: int, seconds: float) -> dict[str, float]:
        """Evaluate the agent.

        Args:
            family: the agent.
            steps: environment steps so far.
            seconds: training time so far.

        Returns:
            Training time, metrics of the agent, and reward of the classical rule.
        """
        self.skip(steps)
        return {"seconds": seconds} | self._measure(family) | {self.reference_key: self.reference_reward}

    def summary(self, metrics: Sequence[dict[str, Any]]) -> list[str]:
        """Return the lines printed after training, from the metrics of the run.

        They are the final metrics, and when the agent surpassed the best reward of the classical rule.
        """
        points = learning_points(metrics)
        if not points:
            return []
        last = points[-1]
        lines = [
            f"Reward {last[REWARD_KEY]:.3f} per {self.unit}, {self.describe(last)}, "
            f"after {last['seconds']:.0f} s of training ({EPISODES} episodes)"
        ]
        best = f"Best reward of the {self.reference}"
        surpassed = next((row for row in points if row[REWARD_KEY] > row[self.reference_key]), None)
        if surpassed is None:
            return [*lines, f"{best} not surpassed: {last[self.reference_key]:.3f}"]
        when = f"after {surpassed['seconds']:.0f} s and {surpassed['step']:,} steps"
        return [*lines, f"{best} surpassed: {last[self.reference_key]:.3f}, {when}"]


class DecisionLearningCurve(LearningCurve):
    """The learning curve of an agent that declares a mode of each segment, next to the SPRT."""

    reference_key, reference_name, reference, unit = "evaluation/sprt", ATE.name, "SPRT", "segment"

    def _reference_reward(self) -> float:
        means = sweep(ATE, self.env_id, EPISODES, seeds.LEARNING_CURVE, **self.options).means
        return float(means[REWARD].max())

    def _measure(self, family: DeciderFamily) -> dict[str, float]:
        decisions = evaluate(
            family.make(family.default), self.env_id, EPISODES, seeds.LEARNING_CURVE, **self.options
        )
        return {
            REWARD_KEY: float(decisions.reward.mean()),
            "evaluation/accuracy": float(decisions.correct.mean()),
            "evaluation/ticks": float(decisions.ticks.mean()),
        }

    def describe(self, point: dict[str, Any]) -> str:
        """Return accuracy and decision time as text."""
        accuracy, ticks = point["evaluation/accuracy"], point["evaluation/ticks"]
        return f"accuracy {accuracy:.1%}, mean decision time {ticks:.1f} ticks"


def learning_points(metrics: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the lines of a run's metrics that `LearningCurve.evaluate` wrote."""
    return [row for row in metrics if REWARD_KEY in row]
