"""A2C of Stable-Baselines3."""

from dataclasses import dataclass

from agents.training.library import LibraryAlgorithm
from agents.training.library_settings import (
    LARGEST_ROLLOUT,
    LibrarySettings,
    check_factor,
    check_weight,
)
from agents.training.settings import LARGEST_COUNT
from hybrid_env.checks import check_integer, check_positive, reject


@dataclass(frozen=True, kw_only=True)
class A2CSettings(LibrarySettings):
    """Hyper-parameters of A2C."""

    # Of each track per rollout.
    n_steps: int
    # Of generalized advantage estimation.
    gae_lambda: float
    # Entropy coefficient of the loss.
    ent_coef: float

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("n_steps", self.n_steps, maximum=LARGEST_COUNT)
        check_factor("gae_lambda", self.gae_lambda)
        check_positive("ent_coef", self.ent_coef, allow_zero=True)
        check_weight("ent_coef", self.ent_coef)
        if self.n_envs * self.n_steps > LARGEST_ROLLOUT:
            raise reject(
                "n_steps",
                self.n_steps,
                f"n_envs x n_steps of at most {LARGEST_ROLLOUT:,}",
            )


class A2C(LibraryAlgorithm):
    """A training run of A2C."""

    name = "a2c"
    Settings = A2CSettings
    library_name = "A2C"
