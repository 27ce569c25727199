"""The learning curve of an agent that states the present mode at every tick."""

from typing import Any

from agents.evaluation import seeds
from agents.evaluation.deciders import DeciderFamily
from agents.training import learning_curve
from agents.training.learning_curve import REWARD_KEY, LearningCurve
from baselines import ThresholdDecider
from baselines.deciders.decider import Decider
from baselines.quickest.metrics import StatementMetrics, measure_statements
from baselines.quickest.statements import record_statements
from hybrid_env.registration import make_track_vector_env

THRESHOLDS = (0.0, 0.4, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)


class StatementCurve(LearningCurve):
    """The learning curve next to the threshold rule on the probabilities of the bank."""

    reference_key, reference_name = "evaluation/threshold", "threshold"
    reference, unit = "threshold rule", "tick"

    def _reference_reward(self) -> float:
        return max(self._run(ThresholdDecider(value)).reward.mean() for value in THRESHOLDS)

    def _measure(self, family: DeciderFamily) -> dict[str, float]:
        metrics = self._run(family.make(family.default))
        return {
            REWARD_KEY: float(metrics.reward.mean()),
            "evaluation/right": float(metrics.right.mean()),
            "evaluation/wrong_changes": float(metrics.wrong_changes.mean()),
        }

    def _run(self, decider: Decider) -> StatementMetrics:
        world = make_track_vector_env(self.env_id, 1, **self.options).options
        recorded = record_statements(decider, learning_curve.EPISODES, seeds.LEARNING_CURVE, **vars(world))
        return measure_statements(recorded, world.change_cost)

    def describe(self, point: dict[str, Any]) -> str:
        """Return the share of right ticks and the frequency of wrong changes as text."""
        right, wrong = point["evaluation/right"], point["evaluation/wrong_changes"]
        return f"right {right:.1%} of the time, {wrong:.1f} wrong changes in 1,000 ticks"
