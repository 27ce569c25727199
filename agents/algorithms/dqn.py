"""DQN of Stable-Baselines3."""

from dataclasses import dataclass
from typing import ClassVar

from agents.training.library import LibraryAlgorithm
from agents.training.library_settings import LibrarySettings, check_factor
from agents.training.settings import LARGEST_COUNT
from hybrid_env.checks import check_integer, ranged

# Transitions, which then take a quarter of a gigabyte with three hypotheses.
LARGEST_BUFFER = 10**6
# Transitions, whose pairs of quantiles then take less than a gigabyte.
LARGEST_BATCH = 2**12


@dataclass(frozen=True, kw_only=True)
class QSettings(LibrarySettings):
    """Hyper-parameters of DQN and QR-DQN; with `net_arch: []` of Q-learning with linear values.

    The loss is quadratic for errors below 1 only: without a scale of the rewards, values of large
    costs would lie near the median of the returns and not at their mean.
    """

    # Transitions of the replay buffer, at least one for each track.
    buffer_size: int
    # Transitions of an update.
    batch_size: int
    # Environment steps before the first update, in which actions are random.
    learning_starts: int
    # Steps of each track between updates.
    train_freq: int
    # Updates then.
    gradient_steps: int
    # Environment steps between updates of the target network, at least n_envs.
    target_update_interval: int
    # Share of the training in which the share of random actions decreases.
    exploration_fraction: float
    # Share of random actions at last.
    exploration_final_eps: float
    exploration_initial_eps: float = 1.0
    # Rewards of a track that a target sums before it takes the value of the network.
    n_steps: int = 1
    # Factor of the rewards.
    reward_scale: float = 1.0

    network_keywords: ClassVar[tuple[str, ...]] = ("net_arch",)
    fewest_layers = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("train_freq", "gradient_steps", "n_steps"):
            check_integer(name, getattr(self, name), maximum=LARGEST_COUNT)
        check_integer("batch_size", self.batch_size, maximum=LARGEST_BATCH)
        check_integer("buffer_size", self.buffer_size, minimum=self.n_envs, maximum=LARGEST_BUFFER)
        check_integer("learning_starts", self.learning_starts, minimum=0)
        check_integer("target_update_interval", self.target_update_interval, minimum=self.n_envs)
        for name in ("exploration_fraction", "reward_scale"):
            check_factor(name, getattr(self, name))
        for name in ("exploration_initial_eps", "exploration_final_eps"):
            ranged(0.0, 1.0)(name, getattr(self, name))


class DQN(LibraryAlgorithm):
    """A training run of DQN."""

    name = "dqn"
    Settings = QSettings
    library_name = "DQN"
