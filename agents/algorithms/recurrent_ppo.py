"""RecurrentPPO of sb3-contrib: PPO with an LSTM."""

from dataclasses import dataclass

from torch import Tensor

from agents.algorithms.ppo import PPOSettings
from agents.training.library import LibraryAlgorithm


@dataclass(frozen=True, kw_only=True)
class RecurrentPPOSettings(PPOSettings):
    """Hyper-parameters of RecurrentPPO."""

    policy_name = "MlpLstmPolicy"
    network_keywords = (
        "net_arch",
        "ortho_init",
        "lstm_hidden_size",
        "n_lstm_layers",
        "enable_critic_lstm",
    )


class RecurrentPPO(LibraryAlgorithm):
    """A training run of RecurrentPPO."""

    name = "recurrent_ppo"
    Settings = RecurrentPPOSettings
    library_name = "RecurrentPPO"

    def track_tensors(self) -> dict[str, Tensor]:
        """See `Algorithm.track_tensors`; with the states of the LSTM."""
        tensors = super().track_tensors()
        states = self.model._last_lstm_states
        for name, pair in (("actor", states.pi), ("critic", states.vf)):
            tensors |= {f"lstm_{name}.{k}": state for k, state in enumerate(pair)}
        return tensors
