"""Simulated paths with measured positions, as an environment with unknown switches."""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces

from baselines.recordings.simulators.aircraft import AIRCRAFT, Aircraft
from baselines.recordings.simulators.airliners import AIRLINERS
from baselines.recordings.simulators.cars import CARS, RoadNet
from baselines.recordings.simulators.paths import CONTROL, Path
from baselines.recordings.simulators.process_noise import LikeliestNoise
from baselines.rules.decider import Actions, Observations
from hybrid_env.checks import BoolArray, FloatArray, IntArray, OwnState
from hybrid_env.live import MeasuredTracks
from hybrid_env.quickest_options import QuickestOptions

VEHICLES: dict[str, Aircraft | RoadNet] = {
    **AIRCRAFT,
    **AIRLINERS,
    **CARS,
}
"""What moves in the worlds, by name."""

MINUTES = 15.0
"""Duration of a path [min]."""

PROCESS = 0.0158
"""Deviation of the velocity by the process noise of a tick over the speed, as in the default
environment.
"""

# Random numbers of the noise are none of the path.
NOISE_STREAM = 1


def world_options(kind: str, tick: float, noise: float) -> dict[str, Any]:
    """Return what deciders are told of a world, as options of `HybridTrackQuickest-v0`.

    Args:
        kind: key of `VEHICLES`.
        tick: [s].
        noise: standard deviation of a measured position [m].
    """
    one = VEHICLES[kind]
    shortest, further = (max(1, round(time / tick)) for time in one.lasting)
    return {
        "radii": (one.radius,),
        "speed": one.speed,
        "tau": tick,
        "measurement_variance": noise**2,
        "process_variance": (PROCESS * one.speed) ** 2,
        "durations": f"{shortest} + geometric {further}",
        "ticks": int(60.0 * MINUTES / tick),
        "initial_error": (0.3, (0.07 * one.speed) ** 2),
    }


# A simulator takes a second for a path, which the nine worlds of a kind share.
@functools.lru_cache(256)
def _path(kind: str, seed: int, duration: float) -> Path:
    return VEHICLES[kind].travel(seed, duration)


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
        factors: process noise of the banks, as factors of that of the options, 1 among them; of
            several, rows are those of the likeliest one, see `process_noise`.

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
        factors: Sequence[float] = (1.0,),
    ):
        self.travel, self.options, self.num_envs = travel, options, tracks
        told = [
            replace(options, process_variance=one * options.process_variance) for one in factors
        ]
        self.worlds = [MeasuredTracks(one, tracks) for one in told]
        self.world = self.worlds[list(factors).index(1.0)]
        self.single_action_space = spaces.Discrete(options.hypotheses)

    def reset(self, *, seed: int | None = None) -> tuple[Observations, dict[str, Any]]:
        """Begin the paths of the seeds, and measure their first positions."""
        assert seed is not None
        self._points, self._modes, starts = self.travel(self.options, self.num_envs, seed)
        self._tick = 0
        self._chooser = LikeliestNoise(self.options)
        for world in self.worlds:
            world.begin_all(starts, np.diag(self.options.start_variances), self._modes[0])
        return self._measure(), {}

    def _measure(self) -> Observations:
        for world in self.worlds:
            world.measure_all(self._points[self._tick])
            world.write("true_mode", self._modes[self._tick])
        self._tick += 1
        return self._rows()

    def _rows(self) -> Observations:
        rows = np.stack([world.take_rows() for world in self.worlds])
        return rows[0] if len(rows) == 1 else self._chooser.choose(rows)

    def step(
        self,
        actions: Actions,
    ) -> tuple[Observations, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Go on to the next positions after statements (N,); after the last ones the episodes
        end.
        """
        for world in self.worlds:
            world.actions[:] = actions
        ended = np.full(self.num_envs, self._tick == len(self._points))
        rows = self._rows() if ended.all() else self._measure()
        return rows, np.zeros(self.num_envs), ended, np.zeros(self.num_envs, np.bool_), {}


def simulated_tracks(
    kind: str,
    options: QuickestOptions,
    tracks: int,
    factors: Sequence[float],
) -> GivenTracks:
    """Return tracks of a key of `VEHICLES`; other arguments as for `GivenTracks`."""
    return GivenTracks(functools.partial(simulated_travel, kind), options, tracks, factors)


def simulated_travel(kind: str, options: QuickestOptions, tracks: int, seed: int) -> Paths:
    """Return paths of a key of `VEHICLES`. Track i has that of `seed` + i, whatever noise and
    tick are.
    """
    deviation = math.sqrt(options.variances[0])
    ends = options.tau * np.arange(options.ticks + 1)
    moments = CONTROL * np.arange(round(60.0 * MINUTES / CONTROL))
    rows = np.minimum(np.searchsorted(moments, ends - 0.5 * CONTROL), len(moments) - 1)
    points = []
    starts = []
    modes = np.empty((options.ticks, tracks), np.int64)
    for track in range(tracks):
        path = _path(kind, seed + track, 60.0 * MINUTES)
        generator = np.random.default_rng([seed + track, NOISE_STREAM])
        exact = np.stack([np.interp(ends, moments, one) for one in path.states.T], axis=1)
        starts.append(exact[0] + np.sqrt(options.start_variances) * generator.standard_normal(4))
        points.append(exact[1:, ::2] + deviation * generator.standard_normal((options.ticks, 2)))
        modes[:, track] = path.modes[rows[1:]]
    return np.stack(points, axis=1), modes, np.array(starts)
