"""A recurrent network that states the present mode; trained on the expected reward itself."""

from typing import NamedTuple

import torch
from torch import Tensor, nn

from agents.learned.statement_inputs import INPUTS

GAIN = 3.0  # of the outputs, so that they learn faster than the recurrent part
INITIAL_STAY = 2.0


class StatementOutputs(NamedTuple):
    """Outputs of T ticks of N tracks.

    Attributes:
        utility: (T, N, M) of stating a mode, in units of log-odds.
        stay: (T, N) utility of not changing the statement, positive.
        belief: (T, N, M) logits of the present mode.
        memory: (1, N (M - 1), hidden) of the recurrent network after the last tick.
    """

    utility: Tensor
    stay: Tensor
    belief: Tensor
    memory: Tensor


class StatementNet(nn.Module):
    """A gated recurrent unit (Cho et al. 2014) that corrects the probabilities of the bank.

    It runs once for each turn hypothesis, with shared weights; straight motion takes the mean of their
    outputs. Without training its utilities are the log-probabilities of the bank.

    Args:
        hidden: units of the recurrent layer.
        inputs: number of inputs of each turn hypothesis.
    """

    def __init__(self, hidden: int, inputs: int = INPUTS):
        super().__init__()
        self.recurrent = nn.GRU(inputs, hidden)
        self.output = nn.Linear(hidden, 5)
        self.scale = nn.Parameter(torch.ones(1))
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def forward(
        self, inputs: Tensor, log_probability: Tensor, memory: Tensor | None = None
    ) -> StatementOutputs:
        """Process T ticks of N tracks.

        Args:
            inputs: (T, N, M - 1, inputs), see `statement_inputs`.
            log_probability: (T, N, M) of the bank.
            memory: of the last call; None begins episodes.
        """
        ticks, tracks, turns, _ = inputs.shape
        hidden, memory = self.recurrent(inputs.reshape(ticks, tracks * turns, -1), memory)
        outputs = GAIN * self.output(hidden).unflatten(1, (tracks, turns))
        mean = outputs.mean(2)
        believed = torch.cat([mean[..., 1, None], outputs[..., 0]], -1)
        preferred = torch.cat([mean[..., 3, None], outputs[..., 2]], -1)
        belief = log_probability + believed
        stay = nn.functional.softplus(mean[..., 4] + INITIAL_STAY)
        return StatementOutputs(self.scale * belief + preferred, stay, belief, memory)
