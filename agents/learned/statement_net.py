"""A recurrent network that states the present mode, and its inputs without units.

The network sees a track once for each turn hypothesis, from the side of this turn: straight motion,
the turn itself, and all other turns together. Lateral innovations are mirrored to the side of the
turn. A mirrored trajectory therefore gives the same inputs for the mirrored turns, and any number
of hypotheses is allowed.
"""

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from baselines.rules.msprt import types_of_radii
from hybrid_env.checks import Float32Array, IntArray
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions

LOWEST_LOG = -15.0
# Gain of the outputs of networks, so that they learn faster than the other layers.
GAIN = 3.0


def statement_inputs(
    world: QuickestOptions, rows: Float32Array, ages: IntArray, more: Float32Array | None = None
) -> Float32Array:
    """Return the inputs of each of the M - 1 turn hypotheses, (..., M - 1, 26 + 3 k).

    Args:
        world: options of the environment.
        rows: (..., width).
        ages: (...) ticks for which the most probable mode has been the same.
        more: (..., M, k) further inputs of the hypotheses, which a mirrored trajectory does not
            change.
    """
    layout = QuickestLayout(world.hypotheses)
    logs = rows[..., layout.slices["log_probability"]] / np.float32(
        layout.scales["log_probability"]
    )
    each = _hypothesis_inputs(layout, rows, logs, ages)
    if more is not None:
        each = np.concatenate([each, more], -1)
    n = each.shape[-1]
    # Index of the innovation across the heading.
    lateral = 4
    out = turn_views(each, logs, sides(layout.hypotheses)[1:], (lateral,), 2)
    speed = np.maximum(rows[..., layout.slices["speed"]], 1e-30)
    radii = np.tile(np.array(world.radii, np.float32), 2)
    # Distance per tick over the deviation of a measurement, and turn angle per tick.
    out[..., 3 * n] = 0.5 * _log(speed)
    out[..., 3 * n + 1] = 0.5 * _log(speed * np.float32(world.deviation) / radii) + 1.5
    return out


def _hypothesis_inputs(
    layout: QuickestLayout, rows: Float32Array, logs: Float32Array, ages: IntArray
) -> Float32Array:
    """Return the inputs of all hypotheses, (..., M, 8), with innovations that are not mirrored."""

    def block(name: str) -> Float32Array:
        return rows[..., layout.slices[name]]

    is_best = np.arange(layout.hypotheses) == logs.argmax(-1)[..., None]
    age = np.where(is_best, ages[..., None], 0).astype(np.float32)
    columns = (
        # Probability, and its logarithm.
        2.0 * np.exp(logs) - 1.0,
        np.maximum(logs, LOWEST_LOG) / 5.0,
        # Log-likelihood of the tick minus the largest.
        np.maximum(block("log_ratio"), -10.0) / 3.0,
        0.5 * np.clip(block("innovation_along"), -6.0, 6.0),
        0.5 * np.clip(block("innovation_across"), -6.0, 6.0),
        # Variance of the innovation over that of the measurement.
        np.minimum(block("log_variance"), 10.0),
        # Ticks for which it has been the most probable mode.
        np.minimum(age / 100.0, 2.0),
        np.log(np.maximum(age, 1.0)) / 5.0,
    )
    return np.stack(columns, axis=-1)


def turn_views(
    each: Float32Array, logs: Float32Array, side: Float32Array, odd: tuple[int, ...], more: int
) -> Float32Array:
    """Return what each turn hypothesis sees: straight motion, itself, the other turns, (..., M -
    1, 3 n + more).

    Args:
        each: (..., M, n) of the hypotheses.
        logs: (..., M) logarithms of their probabilities, by which the others are weighted.
        side: (..., M - 1) of the turns, 1 left, -1 right; it also mirrors what a turn sees.
        odd: columns that change their sign in a mirrored trajectory.
        more: number of further columns, which are not written.
    """
    turns = each[..., 1:, :]
    n = each.shape[-1]
    out = np.empty((*turns.shape[:-1], 3 * n + more), np.float32)
    out[..., :n] = each[..., :1, :]
    out[..., n : 2 * n] = turns
    out[..., 2 * n : 3 * n] = _others(logs[..., 1:], turns)
    for column in odd:
        out[..., column : 3 * n : n] *= side[..., None]
    return out


def sides(hypotheses: int) -> Float32Array:
    """Return 0 for straight motion, 1 for left and -1 for right turns, (M,)."""
    return np.array([0, 1, -1], np.float32)[types_of_radii(hypotheses)]


def _others(logs: Float32Array, turns: Float32Array) -> Float32Array:
    """Return the mean inputs of all turns but one, weighted by their probabilities, (..., M - 1,
    n).
    """
    if logs.shape[-1] <= 2:
        return turns[..., ::-1, :]
    without = np.where(np.eye(logs.shape[-1], dtype=np.bool_), -np.inf, logs[..., None, :])
    weights = np.exp(without - without.max(-1, keepdims=True))
    weights /= weights.sum(-1, keepdims=True)
    return np.asarray(weights.astype(np.float32) @ turns)


def _log(values: Any) -> Float32Array:
    return np.asarray(np.clip(np.log(values), -10.0, 10.0), np.float32)


def zero_layer(inputs: int, outputs: int) -> nn.Linear:
    """Return a linear layer whose outputs are zero until it is trained."""
    layer = nn.Linear(inputs, outputs)
    for parameter in layer.parameters():
        nn.init.zeros_(parameter)
    return layer


class StatementOutputs(NamedTuple):
    """Outputs of T ticks of N tracks.

    Attributes:
        utility: (T, N, M) of stating a mode, in units of log-odds.
        stay: (T, N) utility of not changing the statement, positive.
        belief: (T, N, M) logits of the present mode.
        memory: after the last tick; of `StatementNet` (1, N (M - 1), hidden).
    """

    utility: Tensor
    stay: Tensor
    belief: Tensor
    memory: Any


class StatementNet(nn.Module):
    """A gated recurrent unit (Cho et al. 2014) that corrects the probabilities of the bank.

    It runs once for each turn hypothesis, with shared weights; straight motion takes the mean of
    their outputs. Without training its utilities are the log-probabilities of the bank.

    Args:
        hidden: units of the recurrent layer.
        inputs: number of inputs of each turn hypothesis.
    """

    def __init__(self, hidden: int, inputs: int):
        super().__init__()
        self.recurrent = nn.GRU(inputs, hidden)
        self.output = zero_layer(hidden, 5)
        self.scale = nn.Parameter(torch.ones(1))

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
        stay = nn.functional.softplus(mean[..., 4] + 2.0)
        return StatementOutputs(self.scale * belief + preferred, stay, belief, memory)
