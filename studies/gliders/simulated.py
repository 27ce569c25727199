"""Simulated flights of gliders, in a moving air that rises where they circle: straight flight with
wiggles and partial turns, and circles in thermals, in a wind that changes slowly, and gusts.
Rolling in and out takes seconds; in circles the turn rate jitters, changes with the heading, and
falls for moments. The lift begins before the circles and ends about with them; it also comes
without. Positions are rounded as in logs, and some are missing. Settings are drawn.
"""

from collections.abc import Sequence
from itertools import zip_longest
from types import SimpleNamespace

import numpy as np
from numpy.random import Generator

from studies.flights.flight import Flight
from studies.flights.labels import Labels
from studies.flights.simulated import GRID, coloured, flown_path
from studies.flights.turns import FloatArray, IntArray
from studies.gliders.circling import air_motion, label_glider
from studies.gliders.logs import error_tier
from studies.shipped.random_worlds import log_uniform

# Ranges of the settings of a flight, log-uniform: winds, speeds and deviations of them [m/s], turn
# rates [deg/s], times [s], shares.
RANGES = {
    "wind": (0.3, 9.0),
    "gusts": (0.2, 1.2),
    "gust_time": (1.5, 8.0),
    "speed": (7.0, 14.0),
    "faster": (1.0, 1.35),
    "speed_jitter": (0.04, 0.18),
    "surge": (0.03, 0.16),
    "surge_time": (1.0, 4.0),
    "rate": (11.0, 28.0),
    "modulation": (0.1, 0.6),
    "jitter": (0.1, 0.45),
    "jitter_time": (2.0, 6.0),
    "roll_in": (1.5, 5.0),
    "roll_out": (2.5, 10.0),
    "straight": (35.0, 400.0),
    "circling": (60.0, 500.0),
    "wander": (0.5, 3.0),
    "wander_time": (0.8, 3.0),
    "wiggle_gap": (15.0, 150.0),
    "dip_gap": (12.0, 80.0),
    "lift": (1.4, 5.0),
    "sink": (0.7, 2.0),
    "bumps": (0.6, 2.2),
    "bump_time": (6.0, 25.0),
    "missing": (1e-4, 0.3),
    "noise": (0.03, 0.5),
    "altitude_noise": (0.1, 2.0),
}
# Time between positions [s].
STEP = 1.0


Turns = tuple[FloatArray, ...]
"""Turns or other events: times at which each begins and ends, its value, and how long the value
rises at the begin and falls at the end, linearly [s].
"""


def one_after_the_other(gaps: FloatArray, lengths: FloatArray, *turns: FloatArray) -> Turns:
    """Return turns with gaps before them, from values, rises and falls; the lengths are the times
    until they fall.
    """
    _, rises, falls = turns
    lengths = np.maximum(lengths, rises)
    ends = np.cumsum(gaps + lengths + falls) - falls
    return ends - lengths, ends, *turns


def values_at(times: FloatArray, turns: Turns) -> FloatArray:
    """Return the values of turns at times (t,)."""
    begins, ends, values, rises, falls = turns
    knots = np.column_stack([begins, begins + rises, ends, ends + falls])
    heights = values[:, None] * [0.0, 1.0, 1.0, 0.0]
    return np.interp(times, np.maximum.accumulate(knots.ravel()), heights.ravel())


def simulate_glider(seconds: float, generator: Generator) -> Flight:
    """Return a simulated flight of some seconds, with settings of its own."""
    ranges = RANGES.items()
    world = SimpleNamespace(**{name: log_uniform(generator, *bounds) for name, bounds in ranges})
    grid = np.arange(0.0, seconds + 2.0 * GRID, GRID)
    path, altitudes = _fly(world, seconds, grid, generator)
    times = np.arange(0.0, seconds, STEP)
    times = times[generator.uniform(size=len(times)) >= world.missing]
    # Rounding of the latitude in logs [m].
    step = float(generator.choice((1.853, 0.185)))
    rounding = step * np.array([np.cos(np.radians(generator.uniform(30.0, 55.0))), 1.0])
    east, north, heights = (np.interp(times, grid, values) for values in (*path.T, altitudes))
    positions = np.column_stack([east, north])
    positions += world.noise * generator.standard_normal(positions.shape)
    heights += world.altitude_noise * generator.standard_normal(len(times))
    return Flight(
        "simulated",
        error_tier("simulated", step),
        times - times[0],
        rounding * np.round(positions / rounding),
        altitudes=np.round(heights),
    )


def _fly(
    world: SimpleNamespace, seconds: float, grid: FloatArray, generator: Generator
) -> tuple[FloatArray, FloatArray]:
    """Return the path (g, 2) and the altitude (g,) at times (g,) [m]."""
    n = int(seconds / 5.0) + 8

    def drawn(low: float, high: float) -> FloatArray:
        return log_uniform(generator, low, high, n)

    gaps = world.straight * np.exp(1.2 * generator.standard_normal(n))
    gaps[0] *= generator.uniform()
    # Circles that follow circles to the other side.
    at_once = generator.uniform(size=n) < 0.2
    sides = np.cumprod(np.where(at_once, -1.0, generator.choice([-1.0, 1.0], n)))
    sizes = sides * world.rate * np.exp(0.2 * generator.standard_normal(n))
    circles = one_after_the_other(
        np.where(at_once, generator.uniform(0.0, 4.0, n), gaps),
        drawn(8.0, world.circling),
        sizes,
        world.roll_in * drawn(0.6, 1.6),
        world.roll_out * drawn(0.5, 2.0),
    )
    angles = np.minimum(5.0 * np.exp(generator.exponential(0.8, n)), 330.0)
    rates = drawn(7.0, 35.0)
    wiggles = one_after_the_other(
        generator.exponential(world.wiggle_gap, n),
        angles / rates,
        rates * generator.choice([-1.0, 1.0], n),
        drawn(0.5, 3.0),
        drawn(0.5, 3.0),
    )
    dips = one_after_the_other(
        generator.exponential(world.dip_gap, n),
        drawn(1.0, 9.0),
        generator.uniform(0.5, 1.4, n),
        drawn(1.0, 3.0),
        drawn(1.0, 3.0),
    )

    def noise(deviation: float, time: float) -> FloatArray:
        return coloured(len(grid), deviation, time, generator)

    def phase() -> float:
        return float(generator.uniform(0.0, 2.0 * np.pi))

    # What the pilot wants, and how far he circles.
    wanted = values_at(grid, circles)
    circling = np.minimum(np.abs(wanted) / world.rate, 1.0)
    heading = np.radians(GRID * np.cumsum(wanted))
    shape = 1.0 + noise(world.jitter, world.jitter_time)
    shape += world.modulation * np.cos(heading + phase() + noise(1.0, 60.0))
    busy = np.exp(noise(0.5, 60.0))
    rough = (0.8 + 0.6 * circling) * np.exp(noise(0.7, 15.0))
    rates = wanted * shape * (1.0 - values_at(grid, dips)) + (1.0 - circling) * values_at(
        grid, wiggles
    )
    # The hand is busier in some minutes than in others.
    rates += busy * noise(world.wander, world.wander_time)
    speeds = 1.0 + noise(world.speed_jitter, 15.0)
    speeds += rough * noise(world.surge, world.surge_time)
    straight_speed = world.speed * (1.0 + (world.faster - 1.0) * (1.0 - circling))
    speeds = straight_speed * np.maximum(speeds, 0.3)
    # A wind that changes slowly, and gusts.
    angle = phase() - np.pi
    wind = [
        mean + noise(0.2 * world.wind, 600.0) + rough * noise(world.gusts, world.gust_time)
        for mean in (world.wind * np.cos(angle), world.wind * np.sin(angle))
    ]
    path, _ = flown_path(np.radians(rates), speeds, generator, np.column_stack(wind))
    # Lift begins before the circles and ends about with them.
    begins, ends, *_ = circles
    ends = np.maximum(ends + generator.uniform(-8.0, 30.0, n), begins + 4.0)
    lift = (
        begins - generator.uniform(4.0, 25.0, n),
        ends,
        world.lift * drawn(0.6, 1.6),
        generator.uniform(2.0, 10.0, n),
        generator.uniform(2.0, 10.0, n),
    )
    climb = values_at(grid, lift) - world.sink + noise(world.bumps, world.bump_time)
    # Beside the centre of the thermal.
    climb += 0.4 * world.lift * circling * np.cos(heading + phase())
    return path, GRID * np.cumsum(climb)


def label_gliders(flights: Sequence[Flight]) -> list[Labels]:
    """Return the labels of simulated flights by both rules; rule b as libigc has it, but all of
    it is in flight.
    """
    # Where ground tracks turned fast, (T, B).
    fast = np.array(list(zip_longest(*map(turns_fast, flights), fillvalue=0)))
    decoded = decode_fast(fast).T
    return [
        label_glider(flight, motion, states[: len(flight.times)])
        for flight, motion, states in zip(flights, air_motion(flights), decoded, strict=True)
    ]


def decode_fast(fast: IntArray) -> IntArray:
    """Return the most probable states (T, B), 1 in circles, given where ground tracks turned
    fast: the decoder of rule b, by Viterbi's algorithm.
    """
    # Probabilities of straight flight and circles at the start and after either, and of slow and
    # fast turns in either.
    start = np.log([0.8, 0.2])
    stays = np.log([[0.982, 0.018], [0.030, 0.970]])
    seen = np.moveaxis(np.log([[0.942, 0.058], [0.093, 0.907]])[:, fast], 0, -1)
    score = start + seen[0]
    back = []
    for likelihoods in seen[1:]:
        ways = score[:, :, None] + stays
        back.append(ways.argmax(1))
        score = ways.max(1) + likelihoods
    states = [score.argmax(1)]
    for before in reversed(back):
        states.append(np.take_along_axis(before, states[-1][:, None], 1)[:, 0])
    return np.array(states[::-1])


def turns_fast(flight: Flight, time: float = 5.0, fast: float = 6.0) -> IntArray:
    """Return 1 where the ground track (n,) turned fast [deg/s] since the last position at least
    a time [s] before.
    """
    moves = np.diff(flight.positions, axis=0)
    bearings = np.arctan2(*np.vstack([moves, moves[-1:]]).T[::-1])
    before = np.searchsorted(flight.times, flight.times - time + 1e-7, "right") - 1
    last = np.maximum(before, 0)
    passed = np.maximum(flight.times - flight.times[last], 1e-9)
    turned = np.degrees(np.abs(np.angle(np.exp(1j * (bearings - bearings[last])))))
    return ((before >= 0) & (turned > fast * passed)).astype(np.int64)
