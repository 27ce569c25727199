"""Inputs of the sequence network without units, from observation rows and filters of its own.

Lengths are divided by the standard deviation of a measurement or by the way of a tick, times by the tick. A
change of units therefore changes no input. Lateral quantities are mirrored to the side of a turn, so that a
mirrored trajectory gives the same inputs for the mirrored hypotheses.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.deciders.decider import Observations
from baselines.deciders.msprt import mode_types
from hybrid_env.core.kalman import LOG_TWO_PI
from hybrid_env.observation import LOG_FLOOR, Layout
from hybrid_env.options import WorldOptions

FloatArray = NDArray[np.float64]
LIMIT = 5.0  # inputs are clipped to +-5
SMALLEST = 1e-12

HYPOTHESIS_INPUTS = (
    "log-likelihood ratio to the best, own filters",
    "the same, bank of the environment",
    "whitened innovation along the heading",
    "whitened innovation across the heading",
    "surprise: log-likelihood of the last measurement",
    "log of innovation variance over R",
    "log of turn angle per tick",
    "straight",
    "declared last",
)
TRACK_INPUTS = (
    "log of ticks",
    "log of ticks left",
    "log of the way of a tick over the deviation of a measurement",
    "log of the deviation of process noise over the speed",
    "log of position variance of the anchor over R",
    "log of velocity variance of the anchor over R",
    "log posterior odds of the best hypothesis",
    "surprise of the best hypothesis",
    "the environment follows all filters",
    "the environment has the anchor-aware bank",
)
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
    "log of the way of a tick over the deviation of a measurement",
    "log of the deviation of process noise over the speed",
    "change of the speed over its deviation",
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
        values = [
            (w.tau, np.sqrt(w.process_variance), w.follow == "bank", w.bank == "anchor_aware") for w in worlds
        ]
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
        ticks, ticks_left, speed: (N,) of the row.
    """

    posterior: FloatArray
    components: FloatArray
    ticks: FloatArray
    ticks_left: FloatArray
    speed: FloatArray

    def select(self, tracks: NDArray[np.bool_]) -> "LastRow":
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
    """Return the logarithms of way of a tick over sqrt(R), of sqrt(Q) over the speed, of sqrt(Q) over sqrt(R)
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


def tick_inputs(
    layout: Layout,
    rows: Observations,
    scales: Scales,
    log_likelihood: FloatArray,
    surprise: FloatArray,
    innovations: FloatArray,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the inputs of every hypothesis, (N, M, 9), and of every track, (N, 10).

    Args:
        layout: of the rows.
        rows: (N, width).
        scales: of the worlds.
        log_likelihood: (N, M) of the own filters, mixed over the components of the anchor.
        surprise: (N, M) increment of the log-likelihood in this tick.
        innovations: (N, M, 3), see `ComponentFilters`, mixed over the components of the anchor.
    """
    log_noise = layout.read(rows, "log_noise")
    motion, process, _, position, velocity = ratios(layout, rows, scales)
    ratio = log_likelihood - log_likelihood.max(-1, keepdims=True)
    others = np.exp(ratio).sum(-1) - 1.0
    best = ratio.argmax(-1)
    turn = turns_per_tick(layout, rows, scales)
    side = np.sign(turn)
    n = layout.hypotheses // 2
    left, right = ratio[:, 1 : n + 1].max(-1), ratio[:, n + 1 :].max(-1)
    side[:, 0] = np.where(left < right, -1.0, 1.0)
    surprise = np.arcsinh((surprise + (LOG_TWO_PI + log_noise)[:, None]) / 3.0)
    ticks, ticks_left = layout.read(rows, "ticks"), layout.read(rows, "ticks_left")
    own = _clip(
        [
            0.1 * np.maximum(ratio, LOG_FLOOR),
            0.1 * layout.read(rows, "log_ratio"),
            np.arcsinh(innovations[..., 0]),
            np.arcsinh(innovations[..., 1]) * side,
            surprise,
            0.5 * (innovations[..., 2] - log_noise[:, None]),
            np.where(turn == 0.0, 0.0, 0.5 * (_log(np.abs(turn)) + 3.0)),
            (turn == 0.0).astype(np.float64),
            layout.read(rows, "previous"),
        ]
    )
    track = _clip(
        [
            0.5 * (np.log(ticks) - 3.0),
            0.5 * (np.log1p(ticks_left) - 4.0),
            0.5 * motion,
            0.5 * (process + 4.0),
            0.5 * (position + 2.0),
            0.5 * (velocity + 6.0),
            -0.1 * np.log(np.maximum(others, np.exp(LOG_FLOOR))),
            surprise[np.arange(len(rows)), best],
            scales.follows_bank,
            scales.anchor_aware,
        ]
    )
    return own, track


def declared_side(layout: Layout, rows: Observations, last: LastRow) -> FloatArray:
    """Return the side of the turn that the anchor follows, (N,): 1 left, -1 right.

    After a straight piece it is the side with the larger posterior.
    """
    decided = layout.read(rows, "previous").argmax(-1)
    kind = mode_types(layout.hypotheses)
    left, right = (last.posterior[:, kind == one].sum(-1) for one in (1, 2))
    return np.select([kind[decided] == 1, kind[decided] == 2, left < right], [1.0, -1.0, -1.0], 1.0)


def anchor_inputs(
    layout: Layout, rows: Observations, scales: Scales, last: LastRow, side: FloatArray
) -> NDArray[np.float32]:
    """Return the inputs for the distribution of the anchor error, (N, 20 + C).

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
        scales.follows_bank,
        scales.anchor_aware,
    ]
    return np.concatenate([_clip(columns), last.components.astype(np.float32)], axis=-1)
