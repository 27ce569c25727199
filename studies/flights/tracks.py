"""Recorded flights as what deciders read: rows as of the environment with unknown switches."""

from functools import cached_property
from typing import Any

import numpy as np

from hybrid_env import QuickestLayout
from studies.flights.turns import Batch, FloatArray, IntArray, TurnEstimates

# Straight, left, right.
MODES = 3
# Probability.
SMALLEST = 1e-300
# Logarithms of likelihood ratios in the rows of the environment are at least this.
LOG_FLOOR = -30.0


class FlightTracks:
    """B pieces of flights of T positions, with the output of the IMM filter.

    Args:
        batch: the pieces.
        estimates: of the IMM filter.
        probabilities: (T, B, 3) of the modes; None takes those of the IMM filter.
    """

    def __init__(
        self,
        batch: Batch,
        estimates: TurnEstimates,
        probabilities: FloatArray | None = None,
    ):
        self.batch, self.estimates = batch, estimates
        chosen = estimates.probabilities if probabilities is None else probabilities
        # (T, B, 3)
        self.log_probability = np.log(np.maximum(chosen, SMALLEST))

    @cached_property
    def turned(self) -> FloatArray:
        """(T, B) angle by which the ground track turned at each position [rad], anticlockwise."""
        moves = np.diff(self.batch.positions, axis=0)
        # Not NaN.
        moved = np.hypot(moves[..., 0], moves[..., 1]) > 0.0
        rows = np.where(
            moved,
            np.arange(len(moves))[:, None],
            0,
        )
        # The track of an object that rests is the last one.
        last = np.maximum.accumulate(rows, axis=0)
        angles = np.take_along_axis(
            np.arctan2(moves[..., 1], moves[..., 0]),
            last,
            axis=0,
        )
        known = np.take_along_axis(moved, last, axis=0)
        change = np.diff(
            np.where(known, angles, 0.0),
            axis=0,
        )
        found = np.zeros(self.batch.times.shape)
        found[2:] = np.where(
            known[:-1],
            np.remainder(change + np.pi, 2.0 * np.pi) - np.pi,
            0.0,
        )
        return found

    def statements_of(self, decider: Any) -> IntArray:
        """Return the statements (T, B) of a decider of `HybridTrackQuickestEnv`. Its rows
        have the probabilities of the modes, the likelihood ratios and the last statement.
        """
        layout = QuickestLayout(MODES)
        likelihoods = self.estimates.log_likelihoods
        rows = np.zeros(
            (*self.batch.times.shape, layout.width),
            np.float32,
        )
        for name, values in (
            ("log_probability", self.log_probability),
            ("log_ratio", likelihoods - likelihoods.max(-1, keepdims=True)),
        ):
            rows[..., layout.slices[name]] = layout.scales[name] * np.maximum(values, LOG_FLOOR)
        total, pieces = self.batch.times.shape
        stated = np.empty((total, pieces), np.int64)
        state = None
        for tick in range(total):
            if tick:
                rows[tick, np.arange(pieces), layout.slices["stated"].start + stated[tick - 1]] = (
                    1.0
                )
            stated[tick], state = decider.predict(
                rows[tick],
                state,
                np.full(pieces, tick == 0),
            )
        return stated
