"""What moves in simulators of others, with noise on its positions, and what deciders are told."""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import find_family, task_of
from baselines import GivenTracks, Scores, measure_statements, record_in
from hybrid_env import QuickestLayout, QuickestOptions
from studies.simulators.aircraft import AIRCRAFT, Aircraft
from studies.simulators.airliners import AIRLINERS
from studies.simulators.cars import CARS, RoadNet
from studies.simulators.paths import CONTROL, Path

# What moves in the worlds, by name.
VEHICLES: dict[str, Aircraft | RoadNet] = {
    **AIRCRAFT,
    **AIRLINERS,
    **CARS,
}
# Deviation of the velocity by the process noise of a tick over the speed, as in the environment.
PROCESS = 0.0158
# Random numbers of the noise are none of the path.
NOISE_STREAM = 1
# Of the mismatch.
MISMATCH_PATHS = 8


# A simulator takes a second for a path, which the nine worlds of a kind share.
@functools.lru_cache(256)
def _path(kind: str, seed: int, duration: float) -> Path:
    return VEHICLES[kind].travel(seed, duration)


@dataclass(frozen=True)
class World:
    """Paths of one kind with noise, in place of the object of `HybridTrackQuickest-v0`."""

    # Key of `VEHICLES`.
    kind: str
    # Length of a tick [s].
    tick: float
    # Standard deviation of a measured position [m].
    noise: float
    # Duration of a path [min].
    minutes: float = 15.0

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"{self.kind}, {self.tick:g} s, {self.noise:g} m"

    def options(self, factor: float = 1.0) -> QuickestOptions:
        """Return what deciders are told, with the process noise times a factor."""
        vehicle = VEHICLES[self.kind]
        shortest, further = (max(1, round(time / self.tick)) for time in vehicle.lasting)
        options: dict[str, Any] = {
            "radii": (vehicle.radius,),
            "speed": vehicle.speed,
            "tau": self.tick,
            "measurement_variance": self.noise**2,
            "process_variance": factor * (PROCESS * vehicle.speed) ** 2,
            "durations": f"{shortest} + geometric {further}",
            "ticks": int(60.0 * self.minutes / self.tick),
            "initial_error": (0.3, (0.07 * vehicle.speed) ** 2),
        }
        told: QuickestOptions = task_of("HybridTrackQuickest-v0", options).options
        return told

    def travel(
        self,
        options: QuickestOptions,
        tracks: int,
        seed: int,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
        """Return the paths of consecutive seeds, as `GivenTracks` takes them. Track i has that of
        `seed` + i, whatever noise and tick are.
        """
        duration = 60.0 * self.minutes
        ends = self.tick * np.arange(options.ticks + 1)
        moments = CONTROL * np.arange(round(duration / CONTROL))
        rows = np.minimum(np.searchsorted(moments, ends - 0.5 * CONTROL), len(moments) - 1)
        points = []
        starts = []
        modes = np.empty((options.ticks, tracks), np.int64)
        errors = np.sqrt(options.start_variances)
        for track in range(tracks):
            path = _path(self.kind, seed + track, duration)
            generator = np.random.default_rng([seed + track, NOISE_STREAM])
            exact = np.stack([np.interp(ends, moments, state) for state in path.states.T], axis=1)
            starts.append(exact[0] + errors * generator.standard_normal(4))
            scatter = math.sqrt(options.variances[0])
            points.append(exact[1:, ::2] + scatter * generator.standard_normal((options.ticks, 2)))
            modes[:, track] = path.modes[rows[1:]]
        return np.stack(points, axis=1), modes, np.array(starts)

    def rewards(
        self,
        name: str,
        episodes: int,
        seed: int,
        factor: float = 1.0,
        likeliest: bool = False,
        thresholds: Sequence[float] = (),
    ) -> Scores:
        """Return the reward of a tick of a decider on every path.

        Args:
            name: of the decider.
            episodes, seed: number of paths, and seed of the first one.
            factor: of the process noise that is told.
            likeliest: whether rows are those of the likeliest process noise, see `GivenTracks`.
            thresholds: of the decider; without any its default.
        """
        options = self.options(factor)
        family = find_family(name, options)
        thresholds = tuple(thresholds) or (family.default,)
        statements = record_in(
            lambda: GivenTracks(
                self.travel,
                options,
                episodes,
                likeliest,
            ),
            [family.make(threshold) for threshold in thresholds],
            seed,
        )
        rewards = [measure_statements(each, options.change_cost).reward for each in statements]
        values = np.stack(rewards, axis=-1)[:, None]
        return Scores(
            family.name,
            family.symbol,
            thresholds,
            ("reward",),
            values,
        )

    def mismatch(self, seed: int) -> float:
        """Return the mean squared whitened innovation of a coordinate, 1 where the model of the
        bank is true.

        It is weighted by the posterior of the hypotheses, which the bank computes with the nominal
        process noise.
        """
        options = self.options()
        env = GivenTracks(self.travel, options, MISMATCH_PATHS)
        layout = QuickestLayout(options.hypotheses)
        rows, _ = env.reset(seed=seed)
        squares = []
        for _ in range(options.ticks - 1):
            rows, *_ = env.step(np.zeros(MISMATCH_PATHS, np.int64))
            each = sum(layout.read(rows, f"innovation_{axis}") ** 2 for axis in ("along", "across"))
            squares.append(0.5 * (np.exp(layout.read(rows, "log_probability")) * each).sum(-1))
        return float(np.mean(squares))


def worlds(modules: Sequence[str], quick: bool = False) -> list[World]:
    """Return the worlds of simulators, given by their Python modules: all that moves in them, at
    each of its ticks and noises; if `quick`, one of each simulator with paths of three minutes.
    """
    every = [
        World(kind, tick, noise)
        for kind, vehicle in VEHICLES.items()
        if vehicle.module in modules
        for tick in vehicle.ticks
        for noise in vehicle.noises
    ]
    if quick:
        last = {VEHICLES[world.kind].module: replace(world, minutes=3.0) for world in every}
        return list(last.values())
    return every
