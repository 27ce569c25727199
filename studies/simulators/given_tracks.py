"""Given paths with noise in place of the object of an environment with unknown switches, and banks
that choose their process noise by the evidence.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from scipy.special import logsumexp

from hybrid_env import LiveTracks, QuickestLayout, QuickestOptions
from studies.simulators.vehicles import FloatArray, IntArray

Rows = NDArray[np.float32]

Paths = tuple[FloatArray, IntArray, FloatArray]
"""Measured positions (T, N, 2) [m], true modes (T, N), and estimates of the states [x, vx, y, vy]
one tick before the first of them (N, 4), with the error of the options.
"""

Travel = Callable[[QuickestOptions, int, int], Paths]
"""Makes the paths of some options, of a number of tracks N and of a seed."""


class LikeliestNoise:
    """Chooses among the rows of banks that differ in their process noise alone.

    The likelihood of a measurement in a bank follows from its rows, as that of multiple models
    (Magill 1965). The logarithms are summed with an exponential memory, so that the choice follows
    an object that drives at constant speed and then brakes.

    Args:
        options: of a bank.
    """

    # Process noise of the banks, over the nominal one.
    factors = tuple(10.0 ** (0.5 * k) for k in range(-2, 5))

    def __init__(self, options: QuickestOptions):
        self.layout = QuickestLayout(options.hypotheses)
        self.transitions = options.transition_matrix
        self.last: FloatArray | None = None
        self.evidence: FloatArray = np.zeros(1)

    def choose(self, rows: Rows) -> Rows:
        """Return the rows (N, width) of the likeliest bank of each track at the next tick of K
        banks, (K, N, width).
        """
        probabilities = np.exp(self.layout.read(rows, "log_probability"))
        prior = probabilities if self.last is None else self.last @ self.transitions
        self.last = probabilities
        squares = sum(
            self.layout.read(rows, f"innovation_{axis}") ** 2 for axis in ("along", "across")
        )
        logs = -0.5 * squares - self.layout.read(rows, "log_variance")
        # Evidence of 50 ticks, with an exponential memory.
        self.evidence = (1.0 - 1.0 / 50.0) * self.evidence + logsumexp(logs, axis=-1, b=prior)
        return rows[self.evidence.argmax(0), np.arange(rows.shape[1])]


class GivenTracks:
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
        self, travel: Travel, options: QuickestOptions, tracks: int, likeliest: bool = False
    ):
        self.travel = travel
        self.options = options
        self.num_envs = tracks
        factors = LikeliestNoise.factors if likeliest else (1.0,)
        self.banks = [
            LiveTracks(replace(options, process_variance=factor * options.process_variance), tracks)
            for factor in factors
        ]
        self.world = self.banks[factors.index(1.0)].world
        self.single_action_space = spaces.Discrete(options.hypotheses)

    def reset(self, *, seed: int | None = None) -> tuple[Rows, dict[str, Any]]:
        """Begin the paths of the seeds, and measure their first positions."""
        assert seed is not None
        self._points, self._modes, starts = self.travel(self.options, self.num_envs, seed)
        self._tick = 0
        self._chooser = LikeliestNoise(self.options)
        for bank in self.banks:
            bank.begin(starts, np.diag(self.options.start_variances), self._modes[0])
        return self._measure(), {}

    def _measure(self) -> Rows:
        """Measure the next positions; after the last ones the rows remain."""
        if self._tick < len(self._points):
            for bank in self.banks:
                bank.measure_all(self._points[self._tick])
                bank.world.write("true_mode", self._modes[self._tick])
        self._tick += 1
        rows = np.stack([bank.world.take_rows() for bank in self.banks])
        return rows[0] if len(rows) == 1 else self._chooser.choose(rows)

    def step(self, actions: IntArray) -> tuple[Any, ...]:
        """Go on to the next positions after statements (N,); after the last ones the episodes
        end.
        """
        for bank in self.banks:
            bank.world.actions[:] = actions
        ended = np.full(self.num_envs, self._tick == len(self._points))
        return self._measure(), np.zeros(self.num_envs), ended, np.zeros(self.num_envs, bool), {}
