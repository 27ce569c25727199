"""RecurrentPPO of sb3-contrib: PPO with an LSTM."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval
from torch import Tensor

from agents.algorithms.ppo import PPOSettings
from agents.learned.torch_defaults import Units
from agents.training.library import LibraryAlgorithm


@dataclass(frozen=True, kw_only=True)
class RecurrentPPOSettings(PPOSettings):
    """Hyper-parameters of RecurrentPPO."""

    policy: Literal["MlpLstmPolicy"]  # type: ignore[assignment]
    network = {  # noqa: RUF012
        **PPOSettings.network,
        "lstm_hidden_size": Units,
        "n_lstm_layers": Annotated[int, Interval(ge=1, le=2)],
        "enable_critic_lstm": bool,
    }


class RecurrentPPO(LibraryAlgorithm):
    """A training run of RecurrentPPO."""

    name = "recurrent_ppo"
    Settings = RecurrentPPOSettings

    def track_tensors(self) -> dict[str, Tensor]:
        """See `Algorithm.track_tensors`; with the states of the LSTM."""
        tensors = super().track_tensors()
        states = self.model._last_lstm_states
        for name, pair in (("actor", states.pi), ("critic", states.vf)):
            tensors |= {f"lstm_{name}.{k}": state for k, state in enumerate(pair)}
        return tensors
