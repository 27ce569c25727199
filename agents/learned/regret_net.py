"""A network that predicts what a declaration of another turn costs in the next segment.

The filter of the declared turn follows the object to the switch and gives the next anchor. If the object
turns otherwise, that anchor is inaccurate, and the next decision is late or wrong. This cost is not in the
reward of the declaration itself.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

FloatArray = NDArray[np.float64]
CONTEXT = 7
"""Inputs that do not depend on the declaration."""

PAIR = 6
"""Inputs that do."""

NEGLIGIBLE_TURN = 1e-3  # difference of turn angles per tick [rad] below which a declaration costs little


class RegretNet(nn.Module):
    """Loss of the next segment, which is 1 - reward, and how much of it a wrong turn causes.

    Args:
        hidden: units of the hidden layers.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.base = nn.Sequential(nn.Linear(CONTEXT, hidden), nn.Tanh(), nn.Linear(hidden, 1))
        self.excess = nn.Sequential(
            nn.Linear(CONTEXT + PAIR, hidden), nn.Tanh(), nn.Linear(hidden, hidden), nn.Tanh(),
            nn.Linear(hidden, 1),
        )  # fmt: skip

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


def regret_inputs(
    declared: FloatArray,
    true: FloatArray,
    motion: FloatArray,
    process: FloatArray,
    ticks_left: FloatArray,
    follows_bank: FloatArray,
    anchor_aware: FloatArray,
) -> tuple[Tensor, Tensor, Tensor]:
    """Return the inputs of the network, (..., 7), (..., 6) and (...), from arrays of one shape (...).

    Args:
        declared, true: turn angle per tick [rad], positive to the left; 0 is straight.
        motion: logarithm of the distance per tick over the standard deviation of a measurement.
        process: logarithm of the deviation of process noise per tick over the speed.
        ticks_left: from the declaration to the switch.
        follows_bank, anchor_aware: 1 or 0, options of the environment.
    """
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
    tensors = [
        torch.from_numpy(np.clip(np.stack(columns, axis=-1), -5.0, 5.0).astype(np.float32))
        for columns in (context, pair)
    ]
    return tensors[0], tensors[1], torch.from_numpy(difference.astype(np.float32))
