"""Given paths with noise in place of the object of an environment with unknown switches."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from gymnasium import spaces

from baselines.recordings.likeliest_noise import FACTORS, LikeliestNoise
from baselines.rules.decider import Actions, Observations
from hybrid_env.checks import BoolArray, FloatArray, Info, IntArray, OwnState
from hybrid_env.live import LiveTracks
from hybrid_env.quickest_options import QuickestOptions

Paths = tuple[FloatArray, IntArray, FloatArray]
"""Measured positions (T, N, 2) [m], true modes (T, N), and estimates of the states [x, vx, y, vy]
one tick before the first of them (N, 4), with the error of the options.
"""

Travel = Callable[[QuickestOptions, int, int], Paths]
"""Makes the paths of some options, of a number of tracks N and of a seed."""


class GivenTracks(OwnState):
    """Given paths with noise as a vector environment with the rows of
    `hybrid_env.HybridTrackQuickestEnv`.

    Bank and deciders know the mode in which a path begins, and an estimate with the error of the
    options.

    Args:
        travel: makes the paths, see `Travel`.
        options: of the bank; `tau` and `measurement_variance` are those of the sensor.
        tracks: N.
        likeliest: whether rows are those of the bank with the likeliest process noise among .1 to
            100 times that of the options, by the evidence of the last 50 ticks.

    Attributes:
        num_envs: N.
        single_action_space: M modes to state.
        world: arrays of the bank with the process noise of the options.
    """

    def __init__(
        self,
        travel: Travel,
        options: QuickestOptions,
        tracks: int,
        likeliest: bool = False,
    ):
        self.travel = travel
        self.options = options
        self.num_envs = tracks
        factors = FACTORS if likeliest else (1.0,)
        self.banks = [
            LiveTracks(
                replace(options, process_variance=factor * options.process_variance),
                tracks,
            )
            for factor in factors
        ]
        self.world = self.banks[factors.index(1.0)].world
        self.single_action_space = spaces.Discrete(options.hypotheses)

    def reset(self, *, seed: int | None = None) -> tuple[Observations, Info]:
        """Begin the paths of the seeds, and measure their first positions."""
        assert seed is not None
        self._points, self._modes, starts = self.travel(self.options, self.num_envs, seed)
        self._tick = 0
        self._chooser = LikeliestNoise(self.options)
        for bank in self.banks:
            bank.begin(starts, np.diag(self.options.start_variances), self._modes[0])
        return self._measure(), {}

    def _measure(self) -> Observations:
        """Measure the next positions; after the last ones the rows remain."""
        if self._tick < len(self._points):
            for bank in self.banks:
                bank.measure_all(self._points[self._tick])
                bank.world.write("true_mode", self._modes[self._tick])
        self._tick += 1
        rows = np.stack([bank.world.take_rows() for bank in self.banks])
        return rows[0] if len(rows) == 1 else self._chooser.choose(rows)

    def step(
        self,
        actions: Actions,
    ) -> tuple[Observations, FloatArray, BoolArray, BoolArray, Info]:
        """Go on to the next positions after statements (N,); after the last ones the episodes
        end.
        """
        for bank in self.banks:
            bank.world.actions[:] = actions
        ended = np.full(self.num_envs, self._tick == len(self._points))
        return self._measure(), np.zeros(self.num_envs), ended, np.zeros(self.num_envs, bool), {}
