"""Training of the agent for objects that move otherwise than deciders are told: `hybridtrack train
--recipe studies/simulators/robust.yml --env HybridTrackQuickest-v0`.

Like the aircraft of simulators they need time to roll into a turn, fly other speeds and banks than
the nominal ones, and weave; like cars they brake for turns and stop. All of it is drawn for each
track, from wide ranges, in ticks and in units of what is told, so that no scale is preferred.
"""

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge
from numpy.random import Generator
from numpy.typing import NDArray

from agents import task_of
from baselines import record_statements
from hybrid_env import ArgumentError, QuickestOptions
from studies.shipped.random_worlds import log_uniform
from studies.shipped.statements import Statements, StatementSettings
from studies.simulators.given_tracks import GivenTracks


@dataclass(frozen=True, kw_only=True)
class InexactSettings(StatementSettings):
    """Hyper-parameters of the agent for objects that move otherwise than told."""

    # Worlds of a round, new ones in each: of objects that move otherwise than told, and of sensors
    # with heavy tails.
    worlds: Annotated[int, Ge(1)]
    heavy_tails: Annotated[int, Ge(0)] = 0
    durations: tuple[str, ...] = ()


class Inexact(Statements):
    """A training run on objects that move otherwise than told, with rows of the likeliest noise."""

    Settings = InexactSettings
    settings: InexactSettings

    @property
    def worlds_count(self) -> int:
        """See `Statements.worlds_count`."""
        return self.settings.worlds + self.settings.heavy_tails

    def prepare(self) -> None:
        """See `Statements.prepare`."""
        super().prepare()
        for name in ("noise", "missed", "sensors", "object_variance", "start"):
            if getattr(self.world, name) != getattr(QuickestOptions(), name):
                raise ArgumentError(f"{name}={getattr(self.world, name)}: expected the default")

    def draw_world(self, generator: Generator, number: int) -> QuickestOptions:
        """See `Statements.draw_world`."""
        draw = draw_options if number < self.settings.worlds else draw_sensor
        return draw(generator, replace(self.world, ticks=self.ticks))

    def make_env(self, world: QuickestOptions, tracks: int) -> Any:
        """See `Statements.make_env`."""
        if world.object_variance is not None:
            return super().make_env(world, tracks)
        return GivenTracks(inexact_travel, world, tracks, likeliest=True)


def draw_options(generator: Generator, options: QuickestOptions) -> QuickestOptions:
    """Draw what deciders are told; the distance of a tick and the process noise stay. Cars have
    laws of two kinds.
    """

    def drawn(low: float, high: float) -> float:
        return float(log_uniform(generator, low, high))

    step = options.speed * options.tau
    # Turn angle told, of the smallest radius [rad/tick].
    angle = drawn(0.012, 0.6)
    # Ticks of the shortest turn, a third of the mean, of some angle [rad].
    turn = drawn(0.5, 2.0) / angle
    # Duration of straight pieces of cars over that of turns.
    straights = drawn(1.0, 6.0)
    texts = [
        f"{max(1, round(shortest))} + geometric {max(1, round(2.0 * shortest))}"
        for shortest in (turn, straights * turn)
    ]
    law = f"straight {texts[1]}, turns {texts[0]}" if generator.random() < 0.45 else texts[0]
    lasting = replace(options, durations=law, hazard=None).law.mean_duration
    # Switches per tick told over the true mean.
    hazard = min(drawn(0.7, 1.4) / lasting, 1.0 - 1.0 / options.hypotheses)
    # Over the square of the distance of a tick.
    variance = drawn(2e-4, 30.0) * step**2
    scale = step / angle / min(options.radii)
    radii = tuple(scale * radius for radius in options.radii)
    return replace(
        options, durations=law, hazard=hazard, measurement_variance=variance, radii=radii
    )


def draw_sensor(generator: Generator, options: QuickestOptions) -> QuickestOptions:
    """Draw the motion and the noise of `HybridTrackQuickestRoad-v0`, of other sensors too."""
    shortest = round(log_uniform(generator, 12.0, 60.0))
    law = f"{shortest} + geometric {2 * shortest}"
    noise = ("student_t 2", "student_t 4", "gaussian")[generator.choice(3, p=(0.5, 0.25, 0.25))]
    return replace(
        task_of("HybridTrackQuickestRoad-v0").options,
        ticks=options.ticks,
        durations=law,
        noise=noise,
        measurement_variance=log_uniform(generator, 0.3, 3.0) * options.variances[0],
        radii=tuple(log_uniform(generator, 0.7, 1.5) * radius for radius in options.radii),
    )


def inexact_travel(
    options: QuickestOptions, tracks: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Return paths of objects that move otherwise than told; the modes are those of the
    environment.

    Tracks with a law of durations for each kind of motion are like those of cars.
    """
    generator = np.random.default_rng(seed)
    nothing = np.zeros(tracks, np.int64)
    modes = record_statements(lambda rows: nothing, tracks, seed, **vars(options)).true_modes
    positions, first = inexact_paths(options, modes, generator)
    starts = first + np.sqrt(options.start_variances) * generator.standard_normal(first.shape)
    noise = np.sqrt(options.variances[0]) * generator.standard_normal(positions.shape)
    return positions + noise, modes, starts


def inexact_paths(
    options: QuickestOptions, modes: NDArray[np.int64], generator: Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions (T, N, 2) [m] of objects in given modes (T, N), and their first states
    (N, 4).
    """
    ticks, tracks = modes.shape
    # [1/m]
    curvatures = np.array(
        [0.0, *(side / radius for side in (1.0, -1.0) for radius in options.radii)]
    )

    def drawn(low: float, high: float) -> NDArray[np.float64]:
        return np.asarray(log_uniform(generator, low, high, tracks))

    def share(probability: float | NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.asarray(generator.random(tracks) < probability)

    car = np.full(tracks, "turns" in str(options.law))
    # Turns that begin at once, and the time constant of the others [ticks].
    sudden = share(0.4)
    smoothing = np.where(sudden, 1.0, 1.0 - np.exp(-1.0 / drawn(0.7, 10.0)))
    # Time between two changes of the speed, and in which it changes by the nominal one [ticks].
    renewal = 1.0 / drawn(60.0, 600.0)
    change = 1.0 / drawn(8.0, 80.0)
    # Standard deviation of the curvature, and its memory [ticks].
    weaving = generator.uniform(0.0, 0.3, tracks) / min(options.radii)
    memory = np.exp(-1.0 / drawn(4.0, 20.0))

    def speeds(mode: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return speeds over what is told; cars brake in turns and sometimes stop."""
        of_cars = np.where(mode > 0, drawn(0.3, 1.0), drawn(0.5, 1.3))
        usual = np.where(car, of_cars, drawn(0.85, 1.15))
        return np.where(car & share(0.15), 0.0, usual)

    heading = generator.uniform(-np.pi, np.pi, tracks)
    speed = drawn(0.85, 1.15)
    position = np.zeros((tracks, 2))
    first = np.zeros((tracks, 4))
    first[:, 1], first[:, 3] = (options.speed * speed * part(heading) for part in (np.cos, np.sin))
    wanted = speed.copy()
    # Curvature of a turn over that told.
    factor = np.ones(tracks)
    curvature = curvatures[modes[0]]
    weave = np.zeros(tracks)
    last = np.full(tracks, -1)
    positions = np.empty((ticks, tracks, 2))
    for tick, mode in enumerate(modes):
        switched = mode != last
        turns = np.where(car, drawn(0.5, 1.6), drawn(0.8, 1.2))
        factor = np.where(switched, turns, factor)
        wanted = np.where(share(renewal) | (switched & car), speeds(mode), wanted)
        speed = speed + np.clip(wanted - speed, -change, change)
        # The bank, not the radius, is kept in the air.
        flown = np.where(car, 1.0, np.maximum(speed, 0.85) ** -2)
        curvature = curvature + smoothing * (curvatures[mode] * factor * flown - curvature)
        noise = generator.standard_normal(tracks)
        weave = memory * weave + np.sqrt(1.0 - memory**2) * weaving * noise
        step = options.speed * options.tau * speed
        turned = (curvature + weave) * step
        direction = heading + 0.5 * turned
        moved = np.stack([np.cos(direction), np.sin(direction)], axis=1)
        position = position + step[:, None] * moved
        heading, last, positions[tick] = heading + turned, mode, position
    return positions, first
