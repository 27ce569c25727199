"""QR-DQN of sb3-contrib: DQN with the quantiles of the return."""

from dataclasses import dataclass

from agents.algorithms.dqn import QSettings
from agents.training.library import LibraryAlgorithm


@dataclass(frozen=True, kw_only=True)
class QuantileSettings(QSettings):
    """Hyper-parameters of QR-DQN."""

    network_keywords = ("net_arch", "n_quantiles")


class QRDQN(LibraryAlgorithm):
    """A training run of QR-DQN."""

    name = "qrdqn"
    Settings = QuantileSettings
    library_name = "QRDQN"
