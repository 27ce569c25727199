"""Inputs of the anchor network without units, from observation rows and filters of its own.

Lengths are divided by the standard deviation of a measurement or by the distance per tick, times by the tick.
A change of units therefore changes no input. Lateral quantities are mirrored to the side of the declared
turn, so that a mirrored trajectory gives the same inputs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.rules.decider import Observations
from baselines.rules.msprt import mode_types
from hybrid_env.checks import BoolArray, FloatArray
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions

LIMIT = 5.0  # inputs are clipped to +-5
SMALLEST = 1e-12

ANCHOR_INPUTS = (
    "log of turn angle per tick",
    "straight",
    "log-odds of the declared hypothesis",
    "log-odds of the declared type",
    "posterior of straight",
    "posterior of the side of the turn",
    "posterior of the other side",
    "mean deviation of the turn angle per tick",
    "standard deviation of the turn angle per tick",
    "log of ticks to the declaration",
    "log of ticks after the declaration",
    "log of position variance of the anchor over R",
    "correlation of position and velocity",
    "log of velocity variance of the anchor over R",
    "log of process over measurement noise",
    "log of the distance per tick over the deviation of a measurement",
    "log of the deviation of process noise over the speed",
    "change of the speed over its deviation",
    "innovation along the heading, declared filter of the bank minus own filter",
    "innovation across the heading, likewise",
    "the environment follows all filters",
    "the environment has the anchor-aware bank",
)
"""Followed by the posterior of every component of the previous anchor."""


@dataclass(frozen=True)
class Scales:
    """What the inputs need from the options of the worlds of N tracks, each (N,).

    Attributes:
        tau: length of a tick [s].
        process_deviation: sqrt(Q) [m/s].
        follows_bank, anchor_aware: 1 or 0.
    """

    tau: FloatArray
    process_deviation: FloatArray
    follows_bank: FloatArray
    anchor_aware: FloatArray

    @classmethod
    def of(cls, worlds: Sequence[WorldOptions], tracks: Sequence[int]) -> "Scales":
        """Return the scales of tracks in several worlds.

        Args:
            worlds: options.
            tracks: number of tracks of each.
        """
        values = [(w.tau, np.sqrt(w.process_variance), w.follow == "bank", w.bank == "anchor_aware") for w in worlds]
        return cls(*np.repeat(np.array(values, np.float64), tracks, axis=0).T)

    def select(self, tracks: NDArray[Any]) -> "Scales":
        """Return the scales of selected tracks, by a mask (N,) or indices."""
        return Scales(
            self.tau[tracks], self.process_deviation[tracks], self.follows_bank[tracks],
            self.anchor_aware[tracks],
        )  # fmt: skip


@dataclass
class LastRow:
    """What is remembered of the row before a switch, on which the declaration was made.

    Attributes:
        posterior: (N, M) of the hypotheses.
        components: (N, C) posterior of the components of the anchor.
        bias: (N, M, 2) innovation along and across the heading over sqrt(R), of the bank minus own filters.
        ticks, ticks_left, speed: (N,) of the row.
    """

    posterior: FloatArray
    components: FloatArray
    bias: FloatArray
    ticks: FloatArray
    ticks_left: FloatArray
    speed: FloatArray

    def select(self, tracks: BoolArray) -> "LastRow":
        """Return the rows of the tracks selected by a mask (N,)."""
        return LastRow(*(part[tracks] for part in vars(self).values()))


def _log(values: FloatArray) -> FloatArray:
    return np.log(np.maximum(values, SMALLEST))


def _log_odds(probability: FloatArray) -> FloatArray:
    clipped = np.clip(probability, SMALLEST, 1.0 - SMALLEST)
    return np.log(clipped) - np.log1p(-clipped)


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


def _clip(columns: Sequence[FloatArray]) -> NDArray[np.float32]:
    return np.clip(np.stack(columns, axis=-1), -LIMIT, LIMIT).astype(np.float32)


def bias_of_bank(layout: Layout, rows: Observations, innovations: FloatArray) -> FloatArray:
    """Return the innovations of the bank minus those of own filters over sqrt(R), (N, M, 2).

    The difference is that of the predicted positions: how far the filter of the bank has drifted.

    Args:
        layout: of the rows.
        rows: (N, width).
        innovations: (N, M, 3), see `ComponentFilters`.
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
        last: of the rows before the switch.
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
        of_type[:, 0],
        of_type[tracks, same],
        of_type[tracks, other],
        np.arcsinh(30.0 * mean),
        np.arcsinh(30.0 * spread),
        0.5 * (np.log(np.maximum(last.ticks, 1.0)) - 3.0),
        0.5 * (np.log1p(last.ticks_left) - 4.0),
        0.5 * (position + 2.0),
        xv / np.sqrt(np.maximum(xx * vv, 1e-300)),
        0.5 * (velocity + 6.0),
        0.3 * (noise + 5.0),
        0.5 * motion,
        0.5 * (process + 4.0),
        np.arcsinh((speed - last.speed) / np.sqrt(np.maximum(variance, 1e-300))),
        np.arcsinh(last.bias[tracks, decided, 0]),
        np.arcsinh(last.bias[tracks, decided, 1]) * side,
        scales.follows_bank,
        scales.anchor_aware,
    ]
    return np.concatenate([_clip(columns), last.components.astype(np.float32)], axis=-1)
