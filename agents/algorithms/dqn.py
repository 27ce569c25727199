"""DQN of Stable-Baselines3."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval, MaxLen

from agents.training.library import LibraryAlgorithm
from agents.training.library_settings import Layer, LibrarySettings
from agents.training.settings import Factor
from hybrid_env.checks import Count, NotNegative, check_integer


@dataclass(frozen=True, kw_only=True)
class QSettings(LibrarySettings):
    """Hyper-parameters of DQN and QR-DQN; with `net_arch: []` of Q-learning with linear values.

    The loss is quadratic for errors below 1 only: without a scale of the rewards, values of large
    costs would lie near the median of the returns and not at their mean.
    """

    # Transitions of the replay buffer, at least one for each track.
    buffer_size: Count
    # Transitions of an update.
    batch_size: Count
    # Environment steps before the first update, in which actions are random.
    learning_starts: NotNegative
    # Steps of each track between updates.
    train_freq: Count
    # Updates then.
    gradient_steps: Count
    # Environment steps between updates of the target network, at least n_envs.
    target_update_interval: Count
    # Share of the training in which the share of random actions decreases.
    exploration_fraction: Factor
    # Share of random actions at last.
    exploration_final_eps: Annotated[float, Interval(ge=0.0, le=1.0)]
    exploration_initial_eps: Annotated[float, Interval(ge=0.0, le=1.0)] = 1.0
    # Rewards of a track that a target sums before it takes the value of the network.
    n_steps: Count = 1
    # Factor of the rewards.
    reward_scale: Factor = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("buffer_size", "target_update_interval"):
            check_integer(name, getattr(self, name), minimum=self.n_envs)


class DQN(LibraryAlgorithm):
    """A training run of DQN."""

    name = "dqn"
    Settings = QSettings
    policy_types = {"net_arch": Annotated[tuple[Layer, ...], MaxLen(8)]}  # noqa: RUF012
