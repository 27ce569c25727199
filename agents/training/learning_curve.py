"""How an agent gets better while it is trained: measured now and then on episodes kept for that."""

import functools
from collections.abc import Sequence
from typing import Any

from agents.evaluation import seeds
from agents.evaluation.deciders import ATE, DeciderFamily
from agents.evaluation.evaluate import evaluate
from agents.evaluation.operating_curve import REWARD, sweep

EPISODES = 200
LEARNED, SPRT = "evaluation/reward", "evaluation/sprt"
FIRST, GROWTH = 3.0, 1.4  # seconds to the first measurement; the next come later by that factor


class LearningCurve:
    """Measures an agent at its default threshold, later and later, beside the SPRT at its best.

    Args:
        env_id: registered id.
        options: of the world, over those of the id.
    """

    def __init__(self, env_id: str, options: dict[str, Any]):
        self.env_id, self.options = env_id, options
        self._next = FIRST

    @functools.cached_property
    def sprt(self) -> float:
        """The SPRT's reward at the best of its thresholds, on the same episodes."""
        means = sweep(ATE, self.env_id, EPISODES, seeds.LEARNING, **self.options).means
        return float(means[REWARD].max())

    def due(self, seconds: float) -> bool:
        """Whether it is time to measure."""
        return seconds >= self._next

    def measure(self, family: DeciderFamily, seconds: float) -> dict[str, float]:
        """Reward, accuracy and ticks of a segment, with the seconds of training before it."""
        while self._next <= seconds:
            self._next *= GROWTH
        decisions = evaluate(
            family.make(family.default), self.env_id, EPISODES, seeds.LEARNING, **self.options
        )
        return {
            "seconds": seconds, LEARNED: float(decisions.reward.mean()),
            "evaluation/accuracy": float(decisions.correct.mean()),
            "evaluation/ticks": float(decisions.ticks.mean()), SPRT: self.sprt,
        }  # fmt: skip


def learning_points(metrics: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The lines of a run's metrics that `LearningCurve.measure` made."""
    return [row for row in metrics if LEARNED in row]


def summary(metrics: Sequence[dict[str, Any]]) -> list[str]:
    """What the terminal says after a training: how good, and when it passed the SPRT at its best."""
    points = learning_points(metrics)
    if not points:
        return []
    last = points[-1]
    lines = [
        f"Reward {last[LEARNED]:.3f} a segment, {last['evaluation/accuracy']:.1%} right at tick "
        f"{last['evaluation/ticks']:.1f}, after {last['seconds']:.0f} s of training ({EPISODES} episodes)"
    ]
    passed = next((row for row in points if row[LEARNED] > row[SPRT]), None)
    if passed is None:
        return [*lines, f"Not past the SPRT's best reward, {last[SPRT]:.3f}"]
    when = f"after {passed['seconds']:.0f} s and {passed['step']:,} steps"
    return [*lines, f"Past the SPRT's best reward, {last[SPRT]:.3f}, {when}"]
