"""Recorded flights as what deciders read: rows as of the environment with unknown switches."""

from typing import Any

import numpy as np
import pandas as pd

from hybrid_env import QuickestLayout
from studies.flights.turns import Batch, FloatArray, IntArray, TurnEstimates


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
        self.log_probability = np.log(np.maximum(chosen, 1e-300))

    @property
    def turned(self) -> FloatArray:
        """(T, B) angle by which the ground track turned at each position [rad], anticlockwise."""
        x, y = np.moveaxis(np.diff(self.batch.positions, axis=0), -1, 0)
        # The track of an object that rests is the last one.
        angles = np.where(np.hypot(x, y) > 0.0, np.arctan2(y, x), np.nan)
        changes = pd.DataFrame(angles).ffill().diff()[1:].to_numpy()
        turned = np.zeros(self.batch.times.shape)
        turned[2:] = np.nan_to_num(np.remainder(changes + np.pi, 2.0 * np.pi) - np.pi)
        return turned

    def statements_of(self, decider: Any) -> IntArray:
        """Return the statements (T, B) of a decider of `HybridTrackQuickestEnv`. Its rows
        have the probabilities of the modes, the likelihood ratios and the last statement.
        """
        layout = QuickestLayout(3)
        likelihoods = self.estimates.log_likelihoods
        rows = np.zeros(
            (*self.batch.times.shape, layout.width),
            np.float32,
        )
        for name, values in (
            ("log_probability", self.log_probability),
            ("log_ratio", likelihoods - likelihoods.max(-1, keepdims=True)),
        ):
            # As in the rows of the environment.
            rows[..., layout.slices[name]] = layout.scales[name] * np.maximum(values, -30.0)
        stated = np.zeros(
            self.batch.times.shape,
            np.int64,
        )
        tracks = np.arange(len(self.batch.pieces))
        state = None
        for tick, row in enumerate(rows):
            if tick:
                row[tracks, layout.slices["stated"].start + stated[tick - 1]] = 1.0
            stated[tick], state = decider.predict(
                row,
                state,
                np.full(len(tracks), tick == 0),
            )
        return stated
