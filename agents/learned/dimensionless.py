"""Inputs of the anchor network without units, from observation rows and filters of its own.

Lengths are divided by the standard deviation of a measurement or by the distance per tick, times by the tick.
A change of units therefore changes no input. Lateral quantities are mirrored to the side of the declared
turn, so that a mirrored trajectory gives the same inputs.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from baselines.rules.decider import Observations
from baselines.rules.msprt import mode_types
from hybrid_env.checks import FloatArray
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions

LIMIT = 5.0  # inputs are clipped to +-5
SMALLEST = 1e-12

ANCHOR_INPUTS = 22  # without the posterior of the components


class Scales(NamedTuple):
    """What the inputs need from the options of the worlds of N tracks, each (N,)."""

    tau: FloatArray  # length of a tick [s]
    process_deviation: FloatArray  # sqrt(Q) [m/s]
    follows_bank: FloatArray  # 1 or 0
    anchor_aware: FloatArray  # 1 or 0

    @classmethod
    def of(cls, worlds: Sequence[WorldOptions], tracks: Sequence[int]) -> "Scales":
        """Return the scales of several worlds, each with a number of tracks."""
        values = [(w.tau, np.sqrt(w.process_variance), w.follow == "bank", w.bank == "anchor_aware") for w in worlds]
        return cls(*np.repeat(np.array(values, np.float64), tracks, axis=0).T)


class LastRow(NamedTuple):
    """What is remembered of the row before a switch, on which the declaration was made."""

    posterior: FloatArray  # (N, M) of the hypotheses
    components: FloatArray  # (N, C) posterior of the components of the anchor
    bias: FloatArray  # (N, M, 2) see `bias_of_bank`
    ticks: FloatArray  # (N,) of the row, as the others
    ticks_left: FloatArray
    speed: FloatArray


Arrays = TypeVar("Arrays", Scales, LastRow)


def select(arrays: Arrays, tracks: NDArray[Any]) -> Arrays:
    """Return the arrays of selected tracks, by a mask (N,) or indices."""
    return type(arrays)(*(part[tracks] for part in arrays))


def _log(values: FloatArray) -> FloatArray:
    return np.log(np.maximum(values, SMALLEST))


def _log_odds(probability: FloatArray) -> FloatArray:
    inside = np.clip(probability, SMALLEST, 1.0 - SMALLEST)
    return np.log(inside) - np.log1p(-inside)


def turns_per_tick(layout: Layout, rows: Observations, scales: Scales) -> FloatArray:
    """Return the turn angle per tick of each hypothesis at the speed of the anchor, (N, M) [rad]."""
    return layout.read(rows, "curvature") * (layout.read(rows, "speed") * scales.tau)[:, None]


def ratios(layout: Layout, rows: Observations, scales: Scales) -> tuple[FloatArray, ...]:
    """Return the logarithms of distance per tick / sqrt(R), of sqrt(Q) / speed, of sqrt(Q) / sqrt(R)
    per tick, and of the variances of the anchor over R; each (N,).
    """
    log_speed = _log(layout.read(rows, "speed"))
    log_tick, log_deviation = np.log(scales.tau), 0.5 * layout.read(rows, "log_noise")
    log_process = np.log(np.maximum(scales.process_deviation, 1e-150))
    return (
        log_speed + log_tick - log_deviation,
        log_process - log_speed,
        log_process + log_tick - log_deviation,
        _log(layout.read(rows, "anchor_xx")),
        np.log(np.maximum(layout.read(rows, "anchor_vv"), 1e-150)) + 2.0 * log_tick,
    )


def clipped(columns: Sequence[FloatArray]) -> NDArray[np.float32]:
    """Return inputs (..., K) within their limits from columns (...)."""
    return np.clip(np.stack(columns, axis=-1), -LIMIT, LIMIT).astype(np.float32)


def bias_of_bank(layout: Layout, rows: Observations, innovations: FloatArray) -> FloatArray:
    """Return the innovations of the bank minus own ones (N, M, 3), see `ComponentFilters`, over sqrt(R), (N, M, 2).

    The difference, along and across the heading, is that of the predicted positions: how far the filter of the bank
    has drifted.
    """
    deviation = np.exp(0.5 * layout.read(rows, "log_variance"))[..., None]
    names = ("innovation_along", "innovation_across")
    of_bank = np.stack([layout.read(rows, name) for name in names], axis=-1) * deviation
    log_noise = layout.read(rows, "log_noise")[:, None, None]
    return of_bank - innovations[..., :2] * np.exp(0.5 * (innovations[..., 2:] - log_noise))


def declared_side(layout: Layout, rows: Observations, last: LastRow) -> FloatArray:
    """Return the side of the turn that the anchor follows, (N,): 1 left, -1 right.

    After a straight segment it is the side with the larger posterior.
    """
    decided = layout.read(rows, "previous").argmax(-1)
    kind = mode_types(layout.hypotheses)
    left, right = (last.posterior[:, kind == one].sum(-1) for one in (1, 2))
    return np.select([kind[decided] == 1, kind[decided] == 2, left < right], [1.0, -1.0, -1.0], 1.0)


def anchor_inputs(
    layout: Layout, rows: Observations, scales: Scales, last: LastRow, side: FloatArray
) -> NDArray[np.float32]:
    """Return the inputs for the distribution of the anchor error, (N, 22 + C).

    Args:
        layout: of the rows.
        rows: (N, width) first rows of a segment.
        scales: of the worlds.
        last: of the rows before the switch; the posterior of its components is the last C inputs.
        side: see `declared_side`.
    """
    tracks = np.arange(len(rows))
    kind = mode_types(layout.hypotheses)
    decided = layout.read(rows, "previous").argmax(-1)
    straight = decided == 0
    posterior = last.posterior
    of_type = np.stack([posterior[:, kind == one].sum(-1) for one in range(3)], axis=-1)
    same, other = np.where(side > 0, 1, 2), np.where(side > 0, 2, 1)
    speed = layout.read(rows, "speed")
    turn = turns_per_tick(layout, rows, scales) * side[:, None]
    within = np.where(kind == kind[decided][:, None], posterior, 0.0)
    within /= np.maximum(within.sum(-1, keepdims=True), SMALLEST)
    deviation = turn - turn[tracks, decided][:, None]
    mean = (within * deviation).sum(-1)
    spread = np.sqrt((within * deviation**2).sum(-1))
    motion, process, noise, position, velocity = ratios(layout, rows, scales)
    xx, xv, vv = (layout.read(rows, name) for name in ("anchor_xx", "anchor_xv", "anchor_vv"))
    variance = layout.read(rows, "anchor_vv") * np.exp(layout.read(rows, "log_noise"))
    variance = variance + scales.process_deviation**2 * (last.ticks + last.ticks_left)
    columns = [
        np.where(straight, 0.0, 0.5 * (_log(np.abs(turn[tracks, decided])) + 3.0)),
        straight.astype(np.float64),
        0.2 * _log_odds(posterior[tracks, decided]),
        0.2 * _log_odds(of_type[tracks, kind[decided]]),
        *(of_type[:, 0], of_type[tracks, same], of_type[tracks, other]),
        *(np.arcsinh(30.0 * one) for one in (mean, spread)),  # of the turn angles per tick
        0.5 * (np.log(np.maximum(last.ticks, 1.0)) - 3.0),
        0.5 * (np.log1p(last.ticks_left) - 4.0),
        0.5 * (position + 2.0),
        xv / np.sqrt(np.maximum(xx * vv, 1e-300)),
        0.5 * (velocity + 6.0),
        0.3 * (noise + 5.0),
        0.5 * motion,
        0.5 * (process + 4.0),
        np.arcsinh((speed - last.speed) / np.sqrt(np.maximum(variance, 1e-300))),  # a change over its deviation
        np.arcsinh(last.bias[tracks, decided, 0]),
        np.arcsinh(last.bias[tracks, decided, 1]) * side,
        *(scales.follows_bank, scales.anchor_aware),
    ]
    return np.concatenate([clipped(columns), last.components.astype(np.float32)], axis=-1)
