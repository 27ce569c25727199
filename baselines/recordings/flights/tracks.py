"""Recorded flights as an environment with unknown switches: the same rows, from filters for turn rates."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from baselines.estimation.turns import Batch, TurnEstimates
from baselines.rules.decider import Actions, Observations
from baselines.rules.rollout import rollout
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.observation import LOG_FLOOR, QuickestLayout

MODES = 3  # straight, left, right
SMALLEST = 1e-300  # probability


class FlightTracks:
    """B pieces of flights, each an episode; rows as of `hybrid_env.HybridTrackQuickestEnv`.

    Of a row, the probabilities of the modes, the likelihood ratios and the last statement are filled.

    Args:
        batch: the pieces.
        estimates: of the IMM filter.
        probabilities: (T, B, 3) of the modes that rows tell; None are those of the IMM.

    Attributes:
        batch, estimates: as given.
        num_envs: B.
        single_action_space: M modes to state.
        tick: index of the present position.
    """

    def __init__(self, batch: Batch, estimates: TurnEstimates, probabilities: FloatArray | None = None):
        self.batch, self.estimates = batch, estimates
        self.num_envs, self.tick = batch.times.shape[1], 0
        self.single_action_space = spaces.Discrete(MODES)
        told = estimates.probabilities if probabilities is None else probabilities
        likelihoods = estimates.log_likelihoods
        layout = QuickestLayout(MODES)
        self._rows = np.zeros((*batch.times.shape, layout.width), np.float32)
        for name, values in (
            ("log_probability", np.log(np.maximum(told, SMALLEST))),
            ("log_ratio", likelihoods - likelihoods.max(-1, keepdims=True)),
        ):
            self._rows[..., layout.slices[name]] = layout.scales[name] * np.maximum(values, LOG_FLOOR)
        self._stated = layout.slices["stated"].start

    @property
    def world(self) -> "FlightTracks":
        """The tracks themselves, for deciders that observe more than rows."""
        return self

    def reset(self, *, seed: int | None = None) -> tuple[Observations, dict[str, Any]]:
        """Begin at the first positions; recordings have no seed."""
        self.tick = 0
        return self._rows[0].copy(), {}

    def step(self, actions: Actions) -> tuple[Observations, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Go on to the next positions after statements (N,); after the last ones the episodes end."""
        last = self.tick == len(self._rows) - 1
        self.tick = min(self.tick + 1, len(self._rows) - 1)
        rows = self._rows[self.tick].copy()
        rows[np.arange(self.num_envs), self._stated + actions] = 1.0
        ended = np.full(self.num_envs, last)
        return rows, np.zeros(self.num_envs), ended, np.zeros(self.num_envs, np.bool_), {}

    def statements(self, decider: Any, lengths: Sequence[int]) -> list[IntArray]:
        """Return the statements of a decider on each flight, (n,); 0 outside of the pieces.

        Args:
            decider: states a mode at every position.
            lengths: number n of positions of each flight.
        """
        stated = np.empty(self.batch.times.shape, np.int64)
        for now in rollout(self, decider, 0):
            if now.step:
                stated[now.step - 1] = now.actions
            if now.step == len(stated):
                break
        return self.batch.unstack(stated, lengths)
