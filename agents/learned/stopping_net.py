"""The network that decides when to declare, and its inputs without units.

It replaces the threshold of the anchor agent (`anchor_decider`): from the stated loss of a
declaration, its recent change, the time, the delay cost and what the filters know it predicts
whether waiting pays. The inputs do not depend on the number of hypotheses, on units or on the side
of a turn.
"""

from typing import NamedTuple, Self

import numpy as np
from torch import Tensor, nn

from agents.learned.anchor_net import (
    Scales,
    clipped,
    log_odds,
    posterior_within,
    ratios,
    turns_per_tick,
)
from agents.learned.statement_net import GAIN, zero_layer
from baselines.rules.decider import Observations
from baselines.rules.msprt import mode_types
from hybrid_env.checks import BoolArray, Float32Array, FloatArray, IntArray
from hybrid_env.observation import Layout

INPUTS = 30
# Of the moving averages of the log-odds.
RATES = np.array([1 / 2, 1 / 5, 1 / 12])
# Error probability.
SMALLEST = 1e-9


class Memory(NamedTuple):
    """What is remembered of the ticks before, for N tracks."""

    # (N, 3) moving averages since the switch.
    log_odds: FloatArray
    # (N, 2) of the squared innovation over 2: since the switch, and since the first one.
    squares: FloatArray

    @classmethod
    def new(cls, tracks: int) -> Self:
        """Return the memory of N tracks before their first tick."""
        return cls(np.zeros((tracks, RATES.size)), np.ones((tracks, 2)))


def stopping_inputs(
    rows: Observations,
    scales: Scales,
    posterior: FloatArray,
    declared: tuple[FloatArray, IntArray],
    by_type: bool,
    squares: FloatArray,
    heavy_tails: FloatArray,
    delay_cost: float,
    memory: Memory,
    first: BoolArray,
) -> tuple[Float32Array, Memory]:
    """Return the inputs of the network (N, 30), and the memory.

    Args:
        rows: (N, width) of the environment.
        scales: of its world.
        posterior: (N, M) of the hypotheses.
        declared: error probability (N,) of the best declaration, and its hypothesis (N,).
        by_type: only the type of motion counts.
        squares: (N,) squared whitened innovation of this hypothesis over 2.
        heavy_tails: (N,) probability of heavy tails.
        delay_cost: of a tick.
        memory: of the tick before.
        first: (N,) True where an episode begins.
    """
    layout = Layout.of_rows(rows)
    error, best = declared
    each = np.arange(len(rows))
    kind = mode_types(layout.hypotheses)
    ticks, left = (layout.read(rows, name) for name in ("ticks", "ticks_left"))
    odds = -log_odds(error, SMALLEST)
    begins = ticks < 1.5
    before = np.where(begins[:, None], odds[:, None], memory.log_odds)
    averages = before + RATES * (odds[:, None] - before)
    square = np.minimum(squares, 40.0)[:, None]
    known = np.where(np.stack([begins, first], -1), 1.0, memory.squares)
    known = known + np.array([1 / 8, 1 / 60]) * (square - known)

    same = kind == kind[best][:, None] if by_type else np.arange(kind.size) == best[:, None]
    rival = np.where(same, -1.0, posterior).argmax(-1)
    turn = turns_per_tick(layout, rows, scales)
    difference = np.log(np.maximum(np.abs(turn[each, best] - turn[each, rival]), 1e-6))
    within = posterior_within(posterior, best)
    spread = np.sqrt((within * (turn - turn[each, best][:, None]) ** 2).sum(-1))
    motion, process, noise, position, velocity = ratios(layout, rows, scales)
    entropy = -(posterior * np.log(np.maximum(posterior, SMALLEST))).sum(-1)
    cost = np.log(max(delay_cost, SMALLEST) / 0.02)
    log_ticks = np.log(np.maximum(ticks, 1.0))
    constants = cost / 2.0, float(by_type), np.log(kind.size / 3.0) / 2.0
    # Logarithm of the distance to the rival over sqrt(R), per squared tick.
    separation = difference + motion
    columns = [
        odds / 4.0,
        *((odds[:, None] - before) / 2.0).T,
        log_ticks - 2.5,
        ticks / 40.0 - 0.5,
        0.5 * (np.log1p(left) - 3.0),
        0.5 * (np.log1p(left) + cost - 3.0),
        *np.log(known).T,
        heavy_tails,
        0.5 * (difference + 3.0),
        0.5 * (separation + 2.0 * log_ticks - 3.0),
        0.5 * (separation + 2.0 * np.log(ticks + 10.0) - 5.0),
        np.log(np.maximum(posterior[each, rival], SMALLEST)) / 4.0,
        np.arcsinh(30.0 * spread),
        np.arcsinh(30.0 * spread * np.sqrt(np.maximum(left, 0.0))) / 2.0,
        entropy,
        (best == 0).astype(float),
        (rival == 0).astype(float),
        0.5 * motion,
        0.5 * (process + 4.0),
        0.3 * (noise + 5.0),
        0.5 * (position + 2.0),
        0.5 * (velocity + 6.0),
        scales.follows_bank,
        scales.anchor_aware,
        *(np.full(len(rows), constant) for constant in constants),
    ]
    return clipped(columns), Memory(averages, known)


class StoppingNet(nn.Module):
    """Log-odds of declaring against waiting, from `stopping_inputs`; `hidden` units in each
    layer.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(INPUTS, hidden),
            nn.SiLU(),
            nn.Linear(hidden, hidden),
            nn.SiLU(),
        )
        self.output = zero_layer(hidden, 1)

    def forward(self, inputs: Tensor) -> Tensor:
        """Return the log-odds (...) from inputs (..., 30). Before training an error of 0.02 is
        the threshold.
        """
        threshold = -float(log_odds(np.array(0.02), SMALLEST))
        logits: Tensor = GAIN * self.output(self.layers(inputs)).squeeze(-1)
        return logits + 4.0 * inputs[..., 0] - threshold
