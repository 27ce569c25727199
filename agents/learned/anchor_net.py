"""The networks of the anchor agent: the distribution of the anchor error, and the cost of a wrong turn.

The bank states a covariance of the anchor that is too small after turns and after wrong declarations. The
network predicts a mixture of normal distributions instead: the filters of every component start from one of
them. It is the learned counterpart of `baselines.rules.anchor_prior`, for all worlds at once.

Another network predicts what a declaration of another turn costs in the next segment. The filter of the
declared turn follows the object to the switch and gives the next anchor. If the object turns otherwise, that
anchor is inaccurate, and the next decision is late or wrong. This cost is not in the reward of the
declaration itself.
"""

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.dimensionless import ANCHOR_INPUTS, clipped
from baselines.rules.anchor_prior import MIRROR
from baselines.rules.component_filters import stated_covariance
from baselines.rules.decider import Observations
from hybrid_env.checks import FloatArray
from hybrid_env.observation import Layout

CONTEXT, PAIR = 7, 6  # inputs that do not depend on the declaration, and that do
NEGLIGIBLE_TURN = 1e-3  # difference of turn angles per tick [rad] below which a declaration costs little
COMPONENTS = 4
INITIAL_LOG_SCALES = (0.0, 1.2, 2.4, 3.6)  # of the standard deviations, relative to those that the bank states
INITIAL_LOG_WEIGHTS = (0.0, -1.0, -3.0, -5.0)
LOWER = torch.tril_indices(4, 4, -1)
SMALLEST_SCALE, LARGEST_SCALE = -6.0, 9.0
NUMBERS = 1 + 4 + 4 + LOWER.shape[1]  # weight, mean, scales and correlations of a component
FLOOR = 1e-3  # of the stated variances, relative to R and to R / tau^2 of the thousandth part


class RegretNet(nn.Module):
    """Loss of the next segment, which is 1 - reward, and how much of it a wrong turn causes."""

    def __init__(self, hidden: int):
        super().__init__()
        self.base = nn.Sequential(nn.Linear(CONTEXT, hidden), nn.Tanh(), nn.Linear(hidden, 1))
        self.excess = nn.Sequential(
            nn.Linear(CONTEXT + PAIR, hidden), nn.Tanh(), nn.Linear(hidden, hidden), nn.Tanh(), nn.Linear(hidden, 1)
        )

    def regret(self, context: Tensor, pair: Tensor, difference: Tensor) -> Tensor:
        """Return the expected increase of the loss (...) from inputs (..., 7), (..., 6) and (...).

        It is zero where the declared and the true turn do not differ.
        """
        share = 1.0 - torch.exp(-(difference / NEGLIGIBLE_TURN).square())
        excess: Tensor = nn.functional.softplus(self.excess(torch.cat([context, pair], dim=-1)))
        return share * excess.squeeze(-1)

    def loss(self, context: Tensor, pair: Tensor, difference: Tensor, losses: Tensor) -> Tensor:
        """Return the mean squared error of the predicted losses (n,)."""
        predicted = self.base(context).squeeze(-1) + self.regret(context, pair, difference)
        return (predicted - losses).square().mean()


def regret_inputs(*values: FloatArray) -> tuple[Tensor, Tensor, Tensor]:
    """Return the inputs of the network, (..., 7), (..., 6) and (...), from seven arrays that broadcast to (...).

    They are the declared and the true turn angle per tick [rad], positive to the left, 0 for straight motion; `motion`
    and `process` of `dimensionless.ratios`; the ticks from the declaration to the switch; 1 or 0 for the options that
    the environment follows all filters, and that its bank is anchor-aware.
    """
    declared, true, motion, process, ticks_left, follows_bank, anchor_aware = np.broadcast_arrays(*values)
    difference = np.abs(declared - true)

    def log_turn(turn: FloatArray) -> FloatArray:
        return np.where(turn == 0.0, 0.0, 0.5 * (np.log(np.maximum(np.abs(turn), 1e-12)) + 3.0))

    log_difference = np.log(np.maximum(difference, 1e-6))
    context = [
        log_turn(true), (true == 0.0).astype(np.float64), 0.5 * motion, 0.5 * (process + 4.0),
        0.5 * (np.log1p(ticks_left) - 4.0), follows_bank, anchor_aware,
    ]  # fmt: skip
    pair = [
        log_turn(declared), (declared == 0.0).astype(np.float64), np.sign(declared) * np.sign(true),
        0.5 * (log_difference + 4.0), 0.5 * (log_difference + motion + 4.0),
        0.5 * (log_difference + motion + np.log1p(ticks_left)),
    ]  # fmt: skip
    of_context, of_pair = (torch.from_numpy(clipped(columns)) for columns in (context, pair))
    return of_context, of_pair, torch.from_numpy(difference.astype(np.float32))


class AnchorNet(nn.Module):
    """Mixture of normal distributions of the anchor error, relative to the covariance that the bank states."""

    def __init__(self, hidden: int):
        super().__init__()
        self.inputs = ANCHOR_INPUTS + COMPONENTS
        self.layers = nn.Sequential(nn.Linear(self.inputs, hidden), nn.Tanh(), nn.Linear(hidden, hidden), nn.Tanh())
        self.output = nn.Linear(hidden, COMPONENTS * NUMBERS)
        nn.init.zeros_(self.output.weight)
        bias = torch.zeros(COMPONENTS, NUMBERS)
        bias[:, 0] = torch.tensor(INITIAL_LOG_WEIGHTS)
        bias[:, 5:9] = torch.tensor(INITIAL_LOG_SCALES)[:, None]
        with torch.no_grad():
            self.output.bias.copy_(bias.flatten())

    def forward(self, inputs: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return log weights (n, C), means (n, C, 4) and Cholesky factors (n, C, 4, 4) of the covariances.

        The inputs are (n, 22 + C), see `dimensionless.anchor_inputs`.
        """
        numbers = self.output(self.layers(inputs)).unflatten(-1, (COMPONENTS, NUMBERS))
        scale = numbers[..., 5:9].clamp(SMALLEST_SCALE, LARGEST_SCALE).exp()
        factor = torch.diag_embed(torch.ones_like(scale))
        factor[..., LOWER[0], LOWER[1]] = numbers[..., 9:]
        return (torch.log_softmax(numbers[..., 0], dim=-1), scale * numbers[..., 1:5], scale[..., None] * factor)

    def loss(self, inputs: Tensor, errors: Tensor) -> Tensor:
        """Return the mean negative log-density of whitened errors, (n, 4)."""
        log_weight, mean, factor = self(inputs)
        white = torch.linalg.solve_triangular(factor, (errors[:, None] - mean)[..., None], upper=False)
        log_determinant = factor.diagonal(dim1=-2, dim2=-1).log().sum(-1)
        log_density = -0.5 * white[..., 0].square().sum(-1) - log_determinant - 2.0 * math.log(2.0 * math.pi)
        return -torch.logsumexp(log_weight + log_density, dim=-1).mean()

    @torch.no_grad()
    def anchors(self, inputs: NDArray[np.float32], whitener: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return log weights (n, C), mean errors (n, C, 4) and covariances (n, C, 4, 4) in the heading frame.

        The inputs are as in `forward`, and the whitener (n, 4, 4) is that of `stated_factor`.
        """
        log_weight, mean, factor = (part.double().numpy() for part in self(torch.from_numpy(inputs)))
        root = whitener[:, None] @ factor
        return log_weight, (whitener[:, None] @ mean[..., None])[..., 0], root @ root.swapaxes(-1, -2)


def stated_factor(layout: Layout, rows: Observations, tau: FloatArray, side: FloatArray) -> FloatArray:
    """Return a factor F with F F' = stated covariance in the mirrored frame, (n, 4, 4), at the first row of a segment.

    The tick `tau` [s] and the side of the turn, 1 or -1, see `dimensionless.declared_side`, are (n,).
    """
    covariance = stated_covariance(layout, rows)
    noise = np.exp(layout.read(rows, "log_noise"))
    for k, floor in ((0, FLOOR * noise), (1, FLOOR * noise / (1000.0 * tau**2))):
        for axis in (k, k + 2):
            covariance[:, axis, axis] = np.maximum(covariance[:, axis, axis], floor)
    limit = 0.99 * np.sqrt(covariance[:, 0, 0] * covariance[:, 1, 1])
    for i, j in ((0, 1), (1, 0), (2, 3), (3, 2)):
        covariance[:, i, j] = np.clip(covariance[:, i, j], -limit, limit)
    signs = np.where(side[:, None] < 0, MIRROR, 1.0)
    return np.asarray(signs[..., None] * np.linalg.cholesky(covariance))
