"""RecurrentPPO of sb3-contrib: PPO with an LSTM."""

from typing import Annotated

from annotated_types import Interval
from torch import Tensor

from agents.algorithms.ppo import PPO
from agents.training.library_settings import Layer


class RecurrentPPO(PPO):
    """A training run of RecurrentPPO."""

    name = "recurrent_ppo"
    policy = "MlpLstmPolicy"
    policy_types = {  # noqa: RUF012
        **PPO.policy_types,
        "lstm_hidden_size": Layer,
        "n_lstm_layers": Annotated[int, Interval(ge=1, le=2)],
        "enable_critic_lstm": bool,
    }

    def track_tensors(self) -> dict[str, Tensor]:
        """See `Algorithm.track_tensors`; with the states of the LSTM."""
        tensors = super().track_tensors()
        states = self.model._last_lstm_states
        for name, pair in (("actor", states.pi), ("critic", states.vf)):
            tensors |= {f"lstm_{name}.{k}": state for k, state in enumerate(pair)}
        return tensors
