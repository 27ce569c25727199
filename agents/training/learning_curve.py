"""The learning curve: periodic evaluation of an agent during training, on episodes reserved for it."""

import functools
from collections.abc import Sequence
from typing import Any

from agents.evaluation import seeds
from agents.evaluation.deciders import ATE, DeciderFamily
from agents.evaluation.evaluate import evaluate
from agents.evaluation.operating_curve import REWARD, sweep

EPISODES = 200
REWARD_KEY, SPRT_KEY = "evaluation/reward", "evaluation/sprt"
FIRST_EVALUATION = 100_000  # environment steps, 2 to 5 s of training
EVALUATION_SPACING = 1.4  # ratio of the steps of consecutive evaluations


class LearningCurve:
    """Evaluates an agent at its default threshold, at geometrically spaced steps, next to the best SPRT.

    Args:
        env_id: registered id.
        options: environment options that override those of the id.
    """

    def __init__(self, env_id: str, options: dict[str, Any]):
        self.env_id, self.options = env_id, options
        self._next = float(FIRST_EVALUATION)

    @functools.cached_property
    def sprt_reward(self) -> float:
        """Mean reward of the SPRT at its best threshold, on the same episodes."""
        means = sweep(ATE, self.env_id, EPISODES, seeds.LEARNING_CURVE, **self.options).means
        return float(means[REWARD].max())

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
            Training time, mean reward, accuracy and decision time per segment, and reward of the SPRT.
        """
        self.skip(steps)
        decisions = evaluate(
            family.make(family.default), self.env_id, EPISODES, seeds.LEARNING_CURVE, **self.options
        )
        return {
            "seconds": seconds, REWARD_KEY: float(decisions.reward.mean()),
            "evaluation/accuracy": float(decisions.correct.mean()),
            "evaluation/ticks": float(decisions.ticks.mean()), SPRT_KEY: self.sprt_reward,
        }  # fmt: skip


def learning_points(metrics: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the lines of a run's metrics that `LearningCurve.evaluate` wrote."""
    return [row for row in metrics if REWARD_KEY in row]


def summary(metrics: Sequence[dict[str, Any]]) -> list[str]:
    """Return the lines printed after training: final metrics, and when the agent surpassed the best SPRT."""
    points = learning_points(metrics)
    if not points:
        return []
    last = points[-1]
    lines = [
        f"Reward {last[REWARD_KEY]:.3f} per segment, accuracy {last['evaluation/accuracy']:.1%}, "
        f"mean decision time {last['evaluation/ticks']:.1f} ticks, after {last['seconds']:.0f} s of training "
        f"({EPISODES} episodes)"
    ]
    surpassed = next((row for row in points if row[REWARD_KEY] > row[SPRT_KEY]), None)
    if surpassed is None:
        return [*lines, f"Best reward of the SPRT not surpassed: {last[SPRT_KEY]:.3f}"]
    when = f"after {surpassed['seconds']:.0f} s and {surpassed['step']:,} steps"
    return [*lines, f"Best reward of the SPRT surpassed: {last[SPRT_KEY]:.3f}, {when}"]
