"""Recorded flights as an environment with unknown switches: the same rows, from filters for turn
rates.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from baselines.estimation.turns import Batch, TurnEstimates
from baselines.rules.decider import Actions, Observations, SeveralThresholds
from baselines.rules.rollout import rollout
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.core.observation_row import LOG_FLOOR
from hybrid_env.observation import QuickestLayout

# Straight, left, right.
MODES = 3
# Probability.
SMALLEST = 1e-300


class FlightTracks:
    """B pieces of flights, each an episode, at positions `tick`. Of the rows of
    `hybrid_env.HybridTrackQuickestEnv`, the probabilities of the modes (T, B, 3), by default of the
    IMM filter, its likelihood ratios and the last statement are filled.
    """

    def __init__(
        self,
        batch: Batch,
        estimates: TurnEstimates,
        probabilities: FloatArray | None = None,
    ):
        self.batch, self.estimates = batch, estimates
        self.num_envs = batch.times.shape[1]
        self.tick = 0
        self.single_action_space = spaces.Discrete(MODES)
        told = estimates.probabilities if probabilities is None else probabilities
        likelihoods = estimates.log_likelihoods
        layout = QuickestLayout(MODES)
        self._rows = np.zeros((*batch.times.shape, layout.width), np.float32)
        for name, values in (
            ("log_probability", np.log(np.maximum(told, SMALLEST))),
            ("log_ratio", likelihoods - likelihoods.max(-1, keepdims=True)),
        ):
            self._rows[..., layout.slices[name]] = layout.scales[name] * np.maximum(
                values,
                LOG_FLOOR,
            )
        self._stated = layout.slices["stated"].start

    @property
    def world(self) -> "FlightTracks":
        """The tracks themselves, for deciders that observe more than rows."""
        return self

    @cached_property
    def turned(self) -> FloatArray:
        """(T, B) angle by which the ground track turned at each position [rad], anticlockwise."""
        moves = np.diff(self.batch.positions, axis=0)
        # Not NaN.
        moved = np.hypot(moves[..., 0], moves[..., 1]) > 0.0
        rows = np.where(moved, np.arange(len(moves))[:, None], 0)
        # The track of an object that rests is the last one.
        last = np.maximum.accumulate(rows, axis=0)
        angles = np.take_along_axis(np.arctan2(moves[..., 1], moves[..., 0]), last, axis=0)
        known = np.take_along_axis(moved, last, axis=0)
        change = np.diff(np.where(known, angles, 0.0), axis=0)
        found = np.zeros(self.batch.times.shape)
        found[2:] = np.where(known[:-1], np.remainder(change + np.pi, 2.0 * np.pi) - np.pi, 0.0)
        return found

    def reset(self, *, seed: int | None = None) -> tuple[Observations, dict[str, Any]]:
        """Begin at the first positions; recordings have no seed."""
        self.tick = 0
        return self._rows[0].copy(), {}

    def step(
        self,
        actions: Actions,
    ) -> tuple[Observations, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Go on to the next positions after statements (N,); after the last ones the episodes
        end.
        """
        last = self.tick == len(self._rows) - 1
        self.tick = min(self.tick + 1, len(self._rows) - 1)
        rows = self._rows[self.tick].copy()
        rows[np.arange(self.num_envs), self._stated + actions] = 1.0
        ended = np.full(self.num_envs, last)
        return rows, np.zeros(self.num_envs), ended, np.zeros(self.num_envs, np.bool_), {}

    def statements(self, decider: Any, lengths: Sequence[int]) -> list[IntArray]:
        """Return the statements of a decider on each flight of n positions, (n,); 0 outside of
        the pieces.
        """
        (stated,) = self.statements_together(decider, lengths, 1)
        return stated

    def statements_together(
        self,
        decider: Any,
        lengths: Sequence[int],
        count: int,
    ) -> list[list[NDArray[Any]]]:
        """Return `statements` of each of the `count` deciders that are computed together."""
        total = len(self.batch.times)
        stated: NDArray[Any] = np.empty((count, *self.batch.times.shape), np.int8)
        for now in rollout(self, decider, 0):
            if now.step:
                several = isinstance(decider, SeveralThresholds)
                stated[:, now.step - 1] = decider.chosen if several else now.actions
            if now.step == total:
                break
        return [self.batch.unstack(one, lengths) for one in stated]
