"""Modes and estimates of a live track some ticks later, when more measurements have come."""

import math
from typing import NamedTuple

import numpy as np

from baselines.estimation.pieces import PIECE_TICKS
from baselines.rules.beam_filters import BY_LAW
from baselines.rules.hindsight import beam_of, choose_modes, smoother_of, starts_of, with_velocities
from baselines.rules.lattice import LatticeWalk, smooth_lattice
from baselines.rules.steady import worth_of
from hybrid_env.checks import FloatArray, Moments
from hybrid_env.quickest_options import QuickestOptions

LARGEST_LAG = PIECE_TICKS - 1


class Settled(NamedTuple):
    """What is known of a tick from its measurement, all before and some that came later.

    Attributes:
        mode: with the one before, and the next ones until now, those with the largest expected
            number of right ticks, less 2 for each change.
        probabilities: (M,) of the modes; those of `smooth_modes` with the same number of branches
            and share of the process noise for a recording that ends now.
        estimate: (4,) [x, vx, y, vy] at the tick, smoothed along the modes.
        covariance: (4, 4) of the estimate.
        time: of the tick, in the unit of the times of a tracker; NaN without them.
    """

    mode: int
    probabilities: FloatArray
    estimate: FloatArray
    covariance: FloatArray
    time: float = math.nan


class FixedLagSmoother:
    """A pass over the lattice of a track that is smoothed over its last ticks, again at each tick.

    Args:
        options: of the environment whose model is assumed.
        lag: number of ticks by which a tick is settled later.
        first: (2,) or (9,) first measurement, see `smooth_modes`.
        start: likewise.
        process_share: likewise.
    """

    def __init__(
        self,
        options: QuickestOptions,
        lag: int,
        first: FloatArray,
        start: Moments | None = None,
        process_share: float = 1.0,
    ):
        # Covariance xx, xy, yy of a measured position [m^2].
        self._noise = np.array([options.variances[0], 0.0, options.variances[-1]])
        # Half of the segments of a beam that decides at once are enough, and take half the time.
        branches = max(32, 8 * options.hypotheses)
        self.model = beam_of(options, branches, process_share)
        self._options = options
        noise = self._noise_of(first)
        starts, rough = starts_of(start, first[:2], noise, options)
        seen, noises = with_velocities(options, first[None], noise[None])
        self._seen = np.full((lag + 1, seen.shape[1]), np.nan)
        self._noises = np.tile(noises, (lag + 1, 1))
        self._walk = LatticeWalk(starts, self.model)
        self._smoother = smoother_of(options, self._seen, self._noises, rough)
        self._arrays = self._walk.arrays(lag + 1)
        # 1 at ticks with a measurement.
        self._measured = np.zeros(lag + 1)
        self._offsets = np.arange(lag + 2) * self._arrays[0][0].size
        self._ends = np.full(lag + 1, BY_LAW)
        self._worth = worth_of(options.types)
        # Mode that was settled last.
        self._mode: int | None = None

    def _noise_of(self, row: FloatArray) -> FloatArray:
        """Return the covariance (3,) of the measured position of a row."""
        return self._noise[0] * row[2:5] if len(row) > 2 else self._noise

    def step(self, row: FloatArray) -> Settled | None:
        """Advance by one tick with a measurement like the first one, NaN if there is none; return
        what is known of the tick `lag` ticks ago, None if there is no such tick.
        """
        for array in (self._seen, self._noises, self._measured, *self._arrays):
            array[:-1] = array[1:]
        now = with_velocities(self._options, row[None], self._noise_of(row)[None])
        self._seen[-1], self._noises[-1] = now[0][0], now[1][0]
        self._measured[-1] = not math.isnan(row[0])
        end = BY_LAW if self._walk.ticks else 0.0
        self._walk.extend(row[None], np.full(1, end), *(array[-1:] for array in self._arrays))
        if self._walk.ticks < len(self._seen):
            return None
        arrays = [array.reshape(-1) for array in self._arrays]
        lattice = self._walk.lattice(self._offsets, arrays, self._ends)
        probabilities = smooth_lattice(lattice, self.model)
        weights = self._measured.copy()
        # Future rows that are counted for the mode of the last one: otherwise no change would be
        # worth its cost with a short lag. Chosen for simulated objects with lags of 1 to 20.
        weights[-1] += 3.0
        worth = probabilities @ self._worth
        modes = choose_modes(worth, weights, last=self._mode)
        begins = np.empty(len(modes), bool)
        begins[0] = modes[0] != self._mode
        begins[1:] = modes[1:] != modes[:-1]
        self._mode = int(modes[0])
        moments = self._smoother.smooth_first(modes, begins)
        return Settled(self._mode, probabilities[0], *moments)
