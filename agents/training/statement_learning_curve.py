"""The learning curve of an agent that states the present mode at every tick."""

from dataclasses import replace
from typing import Any

from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.statement_curve import (
    REWARD,
    RIGHT,
    WRONG_CHANGES,
    StatementCurve,
    mean_of,
    sweep_statements,
)
from agents.evaluation.statement_deciders import threshold_family
from agents.training import learning_curve
from agents.training.learning_curve import REWARD_KEY, LearningCurve
from baselines.rules import seeds
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import make_track_vector_env


class StatementLearningCurve(LearningCurve):
    """The learning curve next to the threshold rule on the probabilities of the bank."""

    reference_key, reference_name = "evaluation/threshold", "IMM threshold"
    reference, unit = "threshold rule", "tick"

    @property
    def _world(self) -> QuickestOptions:
        world: QuickestOptions = make_track_vector_env(self.env_id, 1, **self.options).options
        return world

    def _sweep(self, family: DeciderFamily) -> StatementCurve:
        return sweep_statements(family, self._world, learning_curve.EPISODES, seeds.LEARNING_CURVE)

    def _reference_reward(self) -> float:
        curve = self._sweep(threshold_family(self._world))
        return float(curve.values(mean_of(REWARD)).max())

    def _measure(self, family: DeciderFamily) -> dict[str, float]:
        curve = self._sweep(replace(family, thresholds=(family.default,)))
        rows = {REWARD_KEY: REWARD, "evaluation/right": RIGHT, "evaluation/wrong_changes": WRONG_CHANGES}
        return {name: float(curve.values(mean_of(row))[0]) for name, row in rows.items()}

    def describe(self, point: dict[str, Any]) -> str:
        """Return the share of right ticks and the frequency of wrong changes as text."""
        right, wrong = point["evaluation/right"], point["evaluation/wrong_changes"]
        return f"right {right:.1%} of the time, {wrong:.1f} wrong changes in 1,000 ticks"
