"""A2C of Stable-Baselines3."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge

from agents.training.library import LibraryAlgorithm
from agents.training.library_settings import LibrarySettings
from agents.training.settings import Factor
from hybrid_env.checks import Count


@dataclass(frozen=True, kw_only=True)
class A2CSettings(LibrarySettings):
    """Hyper-parameters of A2C."""

    # Steps of each track per rollout.
    n_steps: Count
    # Lambda of generalized advantage estimation.
    gae_lambda: Factor
    # Entropy coefficient of the loss.
    ent_coef: Annotated[float, Ge(0.0)]


class A2C(LibraryAlgorithm):
    """A training run of A2C."""

    name = "a2c"
    Settings = A2CSettings
