"""QR-DQN of sb3-contrib: DQN with the quantiles of the return."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from agents.algorithms.dqn import QSettings
from agents.training.library import LibraryAlgorithm


@dataclass(frozen=True, kw_only=True)
class QuantileSettings(QSettings):
    """Hyper-parameters of QR-DQN."""

    network = QSettings.network | {"n_quantiles": Annotated[int, Interval(ge=1, le=200)]}


class QRDQN(LibraryAlgorithm):
    """A training run of QR-DQN."""

    name = "qrdqn"
    Settings = QuantileSettings
