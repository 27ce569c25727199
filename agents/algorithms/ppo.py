"""PPO of Stable-Baselines3."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge

from agents.algorithms.a2c import A2CSettings
from agents.training.library import LibraryAlgorithm
from hybrid_env.checks import Count, reject


@dataclass(frozen=True, kw_only=True)
class PPOSettings(A2CSettings):
    """Hyper-parameters of PPO and RecurrentPPO."""

    # Size of a mini-batch; a divisor of n_envs x n_steps.
    batch_size: Annotated[int, Ge(2)]
    # Passes over a rollout per update.
    n_epochs: Count

    def __post_init__(self) -> None:
        super().__post_init__()
        samples = self.n_envs * self.n_steps
        if samples % self.batch_size:
            raise reject(
                "batch_size", self.batch_size, f"a divisor of n_envs x n_steps = {samples}"
            )


class PPO(LibraryAlgorithm):
    """A training run of PPO."""

    name = "ppo"
    Settings = PPOSettings
