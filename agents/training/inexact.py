"""Objects that move otherwise than deciders are told, for the training of an agent.

Like the aircraft of simulators they need time to roll into a turn, fly other speeds and banks than
the nominal ones, and weave; like cars they brake for turns and stop. All of it is drawn for each
track, from wide ranges, in ticks and in units of what is told, so that no scale is preferred.
"""

import functools
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.random import Generator

from baselines.recordings.given_tracks import Paths
from baselines.recordings.log_uniform import log_uniform
from baselines.rules.rollout import record_in, statement_env
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.durations import ModeDurations, parse_durations
from hybrid_env.quickest_options import QuickestOptions

Range: TypeAlias = tuple[float, float]
"""Smallest and largest value."""


@dataclass(frozen=True)
class Ranges:
    """Ranges that the properties of a track are drawn from."""

    # Probability that a turn begins at once.
    sudden: float = 0.4
    # Else time constant of its rate [ticks].
    lag: Range = (0.7, 10.0)
    # Mean time between two changes of the speed [ticks].
    renewed: Range = (60.0, 600.0)
    # Time in which the speed changes by the nominal one [ticks].
    change: Range = (8.0, 80.0)
    # Over what is told, as those of cars, also in turns.
    speeds: Range = (0.85, 1.15)
    car_speeds: Range = (0.5, 1.3)
    turn_speeds: Range = (0.3, 1.0)
    # Probability that a car stops when its speed changes.
    stops: float = 0.15
    # Curvature of a turn over that told, and that of cars.
    turns: Range = (0.8, 1.2)
    car_turns: Range = (0.5, 1.6)
    # Largest standard deviation of the curvature over that of the turn.
    weaving: float = 0.3
    # Memory of the weaving [ticks].
    weaves: Range = (4.0, 20.0)


def draw_told(generator: Generator, options: QuickestOptions) -> QuickestOptions:
    """Draw what deciders are told; the distance of a tick and the process noise stay. Cars have
    laws of two kinds.
    """

    def drawn(bounds: Range) -> float:
        return float(log_uniform(generator, *bounds))

    step = options.speed * options.tau
    # Turn angle told, of the smallest radius [rad/tick].
    angle = drawn((0.012, 0.6))
    # Ticks of the shortest turn, a third of the mean, of some angle [rad].
    turn = drawn((0.5, 2.0)) / angle
    # Duration of straight pieces of cars over that of turns.
    straights = drawn((1.0, 6.0))
    texts = [
        f"{max(1, round(shortest))} + geometric {max(1, round(2.0 * shortest))}"
        for shortest in (turn, straights * turn)
    ]
    law = f"straight {texts[1]}, turns {texts[0]}" if generator.random() < 0.45 else texts[0]
    # Switches per tick told over the true mean.
    hazard = min(
        drawn((0.7, 1.4)) / parse_durations(law).mean_duration,
        1.0 - 1.0 / options.hypotheses,
    )
    # Over the square of the distance of a tick.
    variance = drawn((2e-4, 30.0)) * step**2
    scale = step / angle / min(options.radii)
    radii = tuple(scale * radius for radius in options.radii)
    return replace(
        options,
        durations=law,
        hazard=hazard,
        measurement_variance=variance,
        radii=radii,
    )


def inexact_travel(options: QuickestOptions, tracks: int, seed: int) -> Paths:
    """Return paths of objects that move otherwise than told; the modes are those of the
    environment.

    Tracks with a law of durations for each kind of motion are like those of cars.
    """
    generator = np.random.default_rng(seed)
    make = functools.partial(statement_env, options, tracks)
    modes = record_in(make, lambda rows: np.zeros(tracks, np.int64), seed)[0].true_modes
    positions, first = inexact_paths(options, modes, generator)
    starts = first + np.sqrt(options.start_variances) * generator.standard_normal(first.shape)
    noise = np.sqrt(options.variances[0]) * generator.standard_normal(positions.shape)
    return positions + noise, modes, starts


def inexact_paths(
    options: QuickestOptions,
    modes: IntArray,
    generator: Generator,
    ranges: Ranges = Ranges(),
) -> tuple[FloatArray, FloatArray]:
    """Return positions (T, N, 2) [m] of objects in given modes (T, N), and their first states
    (N, 4).
    """
    ticks, tracks = modes.shape
    # [1/m]
    curvatures = np.array(
        [0.0, *(side / radius for side in (1.0, -1.0) for radius in options.radii)]
    )

    def spread(bounds: Range) -> FloatArray:
        return np.asarray(log_uniform(generator, *bounds, tracks))

    def share(probability: float | FloatArray) -> BoolArray:
        return np.asarray(generator.random(tracks) < probability)

    car = np.full(tracks, isinstance(options.law, ModeDurations))
    smoothing = np.where(share(ranges.sudden), 1.0, 1.0 - np.exp(-1.0 / spread(ranges.lag)))
    # Speeds are those over what is told.
    renewal = 1.0 / spread(ranges.renewed)
    change = 1.0 / spread(ranges.change)
    weaving = generator.uniform(0.0, ranges.weaving, tracks) / min(options.radii)
    memory = np.exp(-1.0 / spread(ranges.weaves))

    def speeds(mode: IntArray) -> FloatArray:
        of_cars = np.where(mode > 0, spread(ranges.turn_speeds), spread(ranges.car_speeds))
        usual = np.where(car, of_cars, spread(ranges.speeds))
        return np.where(car & share(ranges.stops), 0.0, usual)

    heading = generator.uniform(-np.pi, np.pi, tracks)
    speed = spread(ranges.speeds)
    position = np.zeros((tracks, 2))
    first = np.zeros((tracks, 4))
    first[:, 1], first[:, 3] = (options.speed * speed * part(heading) for part in (np.cos, np.sin))
    wanted = speed.copy()
    factor = np.ones(tracks)
    curvature = curvatures[modes[0]]
    weave = np.zeros(tracks)
    last = np.full(tracks, -1)
    positions = np.empty((ticks, tracks, 2))
    for tick, mode in enumerate(modes):
        switched = mode != last
        factor = np.where(
            switched, np.where(car, spread(ranges.car_turns), spread(ranges.turns)), factor
        )
        wanted = np.where(share(renewal) | (switched & car), speeds(mode), wanted)
        speed = speed + np.clip(wanted - speed, -change, change)
        # The bank, not the radius, is kept in the air.
        flown = np.where(car, 1.0, np.maximum(speed, ranges.speeds[0]) ** -2)
        curvature = curvature + smoothing * (curvatures[mode] * factor * flown - curvature)
        weave = memory * weave + np.sqrt(1.0 - memory**2) * weaving * generator.standard_normal(
            tracks
        )
        step = options.speed * options.tau * speed
        turned = (curvature + weave) * step
        direction = heading + 0.5 * turned
        position = position + step[:, None] * np.stack(
            [np.cos(direction), np.sin(direction)],
            axis=1,
        )
        heading, last, positions[tick] = heading + turned, mode, position
    return positions, first
