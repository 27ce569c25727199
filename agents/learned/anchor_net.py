"""The networks of the anchor agent.

The bank states a covariance of the anchor that is too small after turns and after wrong
declarations. `AnchorNet` predicts a mixture of normal distributions instead: the filters of every
component start from one of them. It is the learned counterpart of `baselines.rules.anchor_errors`,
for all environments at once.

`RegretNet` predicts what a declaration of another turn costs in the next segment. The filter of the
declared turn follows the object to the switch and gives the next anchor. If the object turns
otherwise, that anchor is inaccurate, and the next decision is late or wrong. This cost is not in
the reward of the declaration itself.

`StoppingNet` predicts from the probability of an error, its recent change, the time, the delay cost
and what the filters know whether waiting pays.
"""

from typing import ClassVar

import torch
from torch import Tensor, nn

from agents.learned.anchor_inputs import log_odds
from agents.learned.statement_net import GAIN, zero_layer
from hybrid_env.checks import Float32Array, FloatArray


class AnchorNet(nn.Module):
    """Mixture of normal distributions of the anchor error, relative to the covariance that the
    bank states.
    """

    components: ClassVar[int] = 4
    inputs: ClassVar[int] = 22 + components

    def __init__(self, hidden: int):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(self.inputs, hidden), nn.Tanh(), nn.Linear(hidden, hidden), nn.Tanh()
        )
        # Weight, mean, scales and correlations of a component.
        numbers = 1 + 4 + 4 + 6
        self.output = zero_layer(hidden, self.components * numbers)
        bias = torch.zeros(self.components, numbers)
        bias[:, 0] = torch.tensor((0.0, -1.0, -3.0, -5.0))
        # Logarithms of the standard deviations, relative to those that the bank states.
        bias[:, 5:9] = torch.tensor((0.0, 1.2, 2.4, 3.6))[:, None]
        with torch.no_grad():
            self.output.bias.copy_(bias.flatten())

    def forward(self, inputs: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return log weights (n, C), means (n, C, 4) and Cholesky factors (n, C, 4, 4) of the
        covariances.

        The inputs are (n, 22 + C), see `anchor_inputs`.
        """
        numbers = self.output(self.layers(inputs)).unflatten(-1, (self.components, -1))
        scale = numbers[..., 5:9].clamp(-6.0, 9.0).exp()
        factor = torch.diag_embed(torch.ones_like(scale))
        row, column = torch.tril_indices(4, 4, -1, device="cpu")
        factor[..., row, column] = numbers[..., 9:]
        return (
            torch.log_softmax(numbers[..., 0], dim=-1),
            scale * numbers[..., 1:5],
            scale[..., None] * factor,
        )

    @torch.no_grad()
    def anchors(
        self, inputs: Float32Array, whitener: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return log weights (n, C), mean errors (n, C, 4) and covariances (n, C, 4, 4) in the
        heading frame.

        The inputs are as in `forward`, and the whitener (n, 4, 4) is that of `stated_factor`.
        """
        log_weight, mean, factor = (
            part.double().numpy() for part in self(torch.from_numpy(inputs))
        )
        root = whitener[:, None] @ factor
        return (
            log_weight,
            (whitener[:, None] @ mean[..., None])[..., 0],
            root @ root.swapaxes(-1, -2),
        )


class RegretNet(nn.Module):
    """Loss of the next segment, which is 1 - reward, and how much of it a wrong turn causes."""

    # Inputs of the turn that is followed come first; the last one is the difference of both turns.
    context: ClassVar[int] = 7
    inputs: ClassVar[int] = 14

    def __init__(self, hidden: int):
        super().__init__()
        self.base = nn.Sequential(nn.Linear(self.context, hidden), nn.Tanh(), nn.Linear(hidden, 1))
        self.excess = nn.Sequential(
            nn.Linear(self.inputs - 1, hidden),
            nn.Tanh(),
            nn.Linear(hidden, hidden),
            nn.Tanh(),
            nn.Linear(hidden, 1),
        )

    def forward(self, inputs: Tensor) -> Tensor:
        """Return the expected increase of the loss (...) from `regret_inputs` (..., 14).

        It is zero where the declared and the true turn do not differ.
        """
        # Below a difference of 1e-3 rad a tick a declaration costs little.
        share = 1.0 - torch.exp(-(inputs[..., -1] / 1e-3).square())
        excess: Tensor = nn.functional.softplus(self.excess(inputs[..., :-1]))
        return share * excess.squeeze(-1)


class StoppingNet(nn.Module):
    """Log-odds of declaring against waiting, from `stopping_inputs`; `hidden` units in each
    layer.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(31, hidden), nn.SiLU(), nn.Linear(hidden, hidden), nn.SiLU()
        )
        self.output = zero_layer(hidden, 1)

    def forward(self, inputs: Tensor) -> Tensor:
        """Return the log-odds (...) from inputs (..., 31). Before training an error of 0.02 is
        the threshold.
        """
        logits: Tensor = GAIN * self.output(self.layers(inputs)).squeeze(-1)
        return logits + 4.0 * inputs[..., 0] + float(log_odds(0.02))


class AnchorNetworks(nn.Module):
    """The networks of the agent, with `hidden` units in each layer."""

    def __init__(self, hidden: int):
        super().__init__()
        self.anchor = AnchorNet(hidden)
        self.regret = RegretNet(hidden)
        self.stopping = StoppingNet(hidden)
