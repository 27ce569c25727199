"""The two kinds of PPO runs: agents that declare a mode, and agents that state one at every tick."""

import math
from typing import ClassVar

import torch

from agents.evaluation.deciders import DeciderFamily, policy_family
from agents.evaluation.statement_deciders import statement_policy_family
from agents.learned.policy import PolicyDecider
from agents.learned.statement_policy import StatementPolicyDecider
from agents.training.learning_curve import LearningCurve
from agents.training.ppo import PPORun
from agents.training.statement_learning_curve import StatementLearningCurve
from hybrid_env.checks import reject
from hybrid_env.options import WorldOptions


class DecisionPPORun(PPORun):
    """A run whose agent waits, or declares a mode of a segment; see `PPORun`."""

    def build(self) -> None:
        """Create model and environments; the initial policy waits."""
        super().build()
        with torch.no_grad():
            self.model.policy.action_net.get_parameter("bias")[0] = self.settings.wait_bias

    @property
    def world(self) -> WorldOptions:
        """Options of the environment."""
        world: WorldOptions = self.model.env.env.options
        return world

    @property
    def decider(self) -> PolicyDecider:
        """The current policy as a decider."""
        return PolicyDecider(self.model.policy)

    def family(self, name: str) -> DeciderFamily:
        """Return the current policy as a family of deciders."""
        return policy_family(name, self.decider)

    def recent_means(self, reward: float, ticks: float) -> tuple[float, float]:
        """See `PPORun.recent_means`; the means of a segment."""
        means = reward / self.world.segments, ticks / self.world.segments
        for name, mean in zip(("reward", "ticks"), means, strict=True):
            self.model.logger.record(f"segment/{name}", mean)
        return means

    def evaluate(self) -> None:
        """Add a point of the learning curve, if the actions are declarations of hypotheses."""
        if self.world.actions == "all":
            super().evaluate()


class StatementPPORun(PPORun):
    """A run whose agent states the present mode at every tick; see `PPORun`.

    Raises:
        ArgumentError: also for a recipe whose initial policy waits.
    """

    curve_class: ClassVar[type[LearningCurve]] = StatementLearningCurve

    def build(self) -> None:
        """Create model and environments."""
        super().build()
        if self.settings.wait_bias:
            allowed = "0 for an agent that states a mode at every tick, which cannot wait"
            raise reject("wait_bias", self.settings.wait_bias, allowed)

    @property
    def decider(self) -> StatementPolicyDecider:
        """The current policy as a decider."""
        return StatementPolicyDecider(self.model.policy)

    def family(self, name: str) -> DeciderFamily:
        """Return the current policy as a family of deciders."""
        return statement_policy_family(name, self.decider)

    def recent_means(self, reward: float, ticks: float) -> tuple[float, float]:
        """See `PPORun.recent_means`; the mean reward of a tick."""
        self.model.logger.record("tick/reward", reward / ticks)
        return reward / ticks, math.nan
