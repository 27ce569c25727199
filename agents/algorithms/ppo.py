"""PPO of Stable-Baselines3."""

from dataclasses import dataclass

from agents.algorithms.a2c import A2CSettings
from agents.training.library import LibraryAlgorithm
from agents.training.settings import LARGEST_COUNT
from hybrid_env.checks import check_integer, reject


@dataclass(frozen=True, kw_only=True)
class PPOSettings(A2CSettings):
    """Hyper-parameters of PPO and RecurrentPPO."""

    # Of a mini-batch; a divisor of n_envs x n_steps.
    batch_size: int
    # Passes over a rollout per update.
    n_epochs: int

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("n_epochs", self.n_epochs, maximum=LARGEST_COUNT)
        check_integer("batch_size", self.batch_size, minimum=2)
        samples = self.n_envs * self.n_steps
        if samples % self.batch_size:
            raise reject(
                "batch_size",
                self.batch_size,
                f"a divisor of n_envs x n_steps = {samples}",
            )


class PPO(LibraryAlgorithm):
    """A training run of PPO."""

    name = "ppo"
    Settings = PPOSettings
    library_name = "PPO"
