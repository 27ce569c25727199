"""What moves in simulators of others, with noise on its positions, and what deciders are told."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from agents import find_decider, task_of
from baselines import Scores, measure_statements, record_in
from hybrid_env import QuickestLayout, QuickestOptions
from studies.simulators.aircraft import Aircraft
from studies.simulators.airliners import Airliner
from studies.simulators.cars import RoadNet
from studies.simulators.given_tracks import GivenTracks
from studies.simulators.vehicles import CONTROL, FloatArray, IntArray, Vehicle

VEHICLES: dict[str, Vehicle] = {
    "light": Aircraft(
        name="c172x",
        height=3e3,
        airspeed=95.0,
        speed=51.0,
        bank=20.0,
        ticks=(0.3, 0.6, 1.2),
        noises=(5.0, 20.0, 80.0),
    ),
    "airliner": Aircraft(
        name="737",
        height=2e4,
        airspeed=280.0,
        speed=192.5,
        bank=25.0,
        turning=0.95,
        ticks=(0.8, 1.6, 3.2),
        noises=(20.0, 100.0, 500.0),
    ),
    "fighter": Aircraft(
        name="f16",
        height=1.5e4,
        airspeed=350.0,
        speed=221.6,
        bank=45.0,
        turning=0.73,
        ticks=(0.5, 1.0, 2.0),
        noises=(20.0, 80.0, 320.0),
    ),
    "regional jet": Airliner(
        name="E190",
        height=1e4,
        airspeed=250.0,
        speed=148.5,
        bank=25.0,
        ticks=(0.8, 1.6, 3.2),
        noises=(20.0, 80.0, 320.0),
    ),
    "narrow-body": Airliner(
        name="A320",
        height=2e4,
        airspeed=270.0,
        speed=186.1,
        bank=25.0,
        ticks=(0.8, 1.6, 3.2),
        noises=(20.0, 100.0, 500.0),
    ),
    "wide-body": Airliner(
        name="B744",
        height=3e4,
        airspeed=270.0,
        speed=217.0,
        bank=20.0,
        ticks=(1.6, 3.2, 6.4),
        noises=(20.0, 100.0, 500.0),
    ),
    "grid": RoadNet(
        flags="--grid --grid.number 6 --grid.length 150 --default.junctions.radius 12"
        " --default.speed 13.9",
        speed=12.5,
        radius=17.9,
        lasting=(1.0, 8.1),
    ),
    "ring roads": RoadNet(
        flags="--spider --spider.arm-number 9 --spider.circle-number 5 --spider.space-radius 150"
        " --spider.omit-center --default.junctions.radius 25 --default.speed 16.7",
        speed=16.0,
        radius=39.0,
        lasting=(1.0, 6.7),
    ),
    "country": RoadNet(
        flags="--rand --rand.iterations 100 --rand.min-distance 200 --rand.max-distance 400"
        " --rand.min-angle 45 --default.junctions.radius 40 --default.speed 22.2",
        speed=16.8,
        radius=51.0,
        lasting=(1.0, 6.6),
    ),
}
"""What moves in the worlds, by name."""


@dataclass(frozen=True)
class World:
    """Paths of one kind with noise, in place of the object of `HybridTrackQuickest-v0`."""

    # Name of what moves.
    kind: str
    vehicle: Vehicle
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
        speed = self.vehicle.speed
        shortest, further = (max(1, round(time / self.tick)) for time in self.vehicle.lasting)
        return task_of(
            "HybridTrackQuickest-v0",
            {
                "radii": (self.vehicle.radius,),
                "speed": speed,
                "tau": self.tick,
                "measurement_variance": self.noise**2,
                # The deviation of the velocity is a share of the speed, as in the environment.
                "process_variance": factor * (0.0158 * speed) ** 2,
                "durations": f"{shortest} + geometric {further}",
                "ticks": int(60.0 * self.minutes / self.tick),
                "initial_error": (0.3, (0.07 * speed) ** 2),
            },
        ).options

    def travel(
        self, options: QuickestOptions, tracks: int, seed: int
    ) -> tuple[FloatArray, IntArray, FloatArray]:
        """Return the paths of consecutive seeds, as `GivenTracks` takes them. Track i has that of
        `seed` + i, whatever noise and tick are.
        """
        ends = self.tick * np.arange(options.ticks + 1)
        errors, scatter = np.sqrt(options.start_variances), np.sqrt(options.variances[0])
        tracked = []
        for track in range(seed, seed + tracks):
            path = self.vehicle.travel(track, 60.0 * self.minutes)
            moments = CONTROL * np.arange(len(path.modes))
            # Random numbers of the noise are none of the path.
            generator = np.random.default_rng([track, 1])
            exact = np.column_stack([np.interp(ends, moments, state) for state in path.states.T])
            start = exact[0] + errors * generator.standard_normal(4)
            measured = exact[1:, ::2] + scatter * generator.standard_normal((options.ticks, 2))
            rows = np.searchsorted(moments, ends[1:] - 0.5 * CONTROL)
            tracked.append((measured, path.modes[np.minimum(rows, len(moments) - 1)], start))
        points, modes, starts = zip(*tracked, strict=True)
        return np.stack(points, axis=1), np.stack(modes, axis=1), np.array(starts)

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
        decider = find_decider(name, options)
        thresholds = tuple(thresholds) or (decider.default,)
        statements = record_in(
            lambda: GivenTracks(self.travel, options, episodes, likeliest),
            decider,
            seed,
            thresholds,
        )
        rewards = [measure_statements(each, options.change_cost).reward for each in statements]
        values = np.stack(rewards, axis=-1)[:, None]
        return Scores(decider.title, decider.symbol, thresholds, ("reward",), values)

    def mismatch(self, seed: int, tracks: int = 8) -> float:
        """Return the mean squared whitened innovation of a coordinate, 1 where the model of the
        bank is true.

        It is weighted by the posterior of the hypotheses, which the bank computes with the nominal
        process noise.
        """
        options = self.options()
        env = GivenTracks(self.travel, options, tracks)
        layout = QuickestLayout(options.hypotheses)
        rows, _ = env.reset(seed=seed)
        squares = []
        for _ in range(options.ticks - 1):
            rows, *_ = env.step(np.zeros(tracks, np.int64))
            each = sum(layout.read(rows, f"innovation_{axis}") ** 2 for axis in ("along", "across"))
            squares.append(0.5 * (np.exp(layout.read(rows, "log_probability")) * each).sum(-1))
        return float(np.mean(squares))


def worlds(modules: Sequence[str], quick: bool = False) -> list[World]:
    """Return the worlds of simulators, given by their Python modules: all that moves in them, at
    each of its ticks and noises; if `quick`, one of each simulator with paths of three minutes.
    """
    every = [
        World(kind, vehicle, tick, noise)
        for kind, vehicle in VEHICLES.items()
        if vehicle.simulator.lower() in modules
        for tick in vehicle.ticks
        for noise in vehicle.noises
    ]
    if quick:
        last = {world.vehicle.simulator: replace(world, minutes=3.0) for world in every}
        return list(last.values())
    return every
