"""Simulated flights that look like the recorded ones, and simulated twins of recorded flights.

In a turn the aircraft rolls in within some seconds and keeps a turn rate that jitters; in straight
motion the heading wanders slowly. Time and position have errors with a Student t distribution, by
the tier. The default settings are those of the recorded flights as a whole, none chosen by the
score of a decider; agents are trained with settings of their own.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from studies.flights.flight import Flight, Tier
from studies.flights.labels import LabelRules, Labels, Pair, label_flight, spans
from studies.flights.turns import STRAIGHT, FloatArray
from studies.shipped.random_worlds import log_uniform

# Step of the integration [s].
GRID = 0.5


@dataclass(frozen=True, kw_only=True)
class FlightWorld:
    """How flights are simulated."""

    # Turn rates, log-uniform [rad/s].
    rates: tuple[float, float] = (0.012, 0.05)
    # Durations of turns, log-uniform [s].
    turns: tuple[float, float] = (16.0, 105.0)
    # Median duration of straight motion [s], log-normal, by default that of the tier; and the
    # deviation of its logarithm.
    straight: float | None = None
    spread: float = 1.0
    # Probability that a turn is followed by one to the other side without straight motion.
    reversal: float = 0.1
    # Time to roll in or out [s].
    roll: float = 4.5
    # Standard deviation of the turn rate in a turn, as a share of it.
    jitter: float = 0.18
    # Its correlation time [s].
    jitter_time: float = 8.0
    # Standard deviation of the turn rate in straight motion [rad/s].
    wander: float = float(np.radians(0.12))
    # Its correlation time [s].
    wander_time: float = 20.0
    # Log-uniform [m/s].
    speeds: tuple[float, float] = (40.0, 160.0)
    # Degrees of freedom of the noise.
    freedom: float = 5.0


# Ranges of the settings that differ from flight to flight in training, log-uniform.
DRAWN = {
    "straight": (30.0, 900.0),
    "reversal": (0.05, 0.3),
    "roll": (2.0, 7.0),
    "jitter": (0.08, 0.3),
    "jitter_time": (4.0, 20.0),
    "wander": (0.0007, 0.007),
    "wander_time": (8.0, 40.0),
    "freedom": (3.5, 12.0),
}
# The other settings in training: turns and speeds have wider ranges.
WIDE = FlightWorld(rates=(0.01, 0.055), turns=(12.0, 120.0), speeds=(25.0, 250.0))


def draw_world(generator: Generator) -> FlightWorld:
    """Return settings of one flight: those of `DRAWN`, and the others of `WIDE`."""
    drawn: dict[str, Any] = {
        name: float(log_uniform(generator, *bounds)) for name, bounds in DRAWN.items()
    }
    return replace(WIDE, **drawn)


def simulate_flight(
    tier: Tier,
    duration: float,
    generator: Generator,
    world: FlightWorld,
    identity: str = "simulated",
) -> Pair:
    """Return a flight of a duration [s] with its labels, which follow from its true turn rates. The
    tier gives noise and steps.
    """
    # Steps as in the tier: reports that repeat a position are missing.
    step, missing, straight = {
        "A": (1.0, 0.15, 720.0),
        "B": (1.0, 0.15, 116.0),
        "C": (5.0, 0.03, 60.0),
        "D": (5.0, 0.4, 60.0),
    }[tier.name]
    steps = step * generator.geometric(1.0 - missing, int(duration / step))
    times = np.append(0.0, np.cumsum(steps))
    if tier.name == "A":
        times += generator.uniform(-0.3, 0.3, len(times))
    times = times[times < duration] - times[0]
    grid = np.arange(0.0, times[-1] + 4.0 * GRID, GRID)

    def lasting() -> float:
        median = world.straight or straight
        return float(median * np.exp(world.spread * generator.standard_normal()))

    wanted = np.zeros(len(grid))
    time = lasting() * generator.uniform()
    side = 0.0
    while time < grid[-1]:
        end = time + log_uniform(generator, *world.turns)
        size = log_uniform(generator, *world.rates)
        reverses = side and generator.uniform() < world.reversal
        side = -side if reverses else generator.choice([-1.0, 1.0])
        wanted[(grid >= time) & (grid < end)] = side * size
        time = end
        if generator.uniform() >= world.reversal:
            time += lasting()
            side = 0.0
    speeds = np.full(len(grid), log_uniform(generator, *world.speeds))
    return fly(identity, tier, times, wanted, speeds, generator, world)


def twin(flight: Flight, labels: Labels, generator: Generator) -> Pair:
    """Return a simulated flight with the steps, speeds and turns of a recorded one, and its true
    modes. The turns have the times and mean rates of the labels.
    """
    times = flight.times
    grid = np.arange(0.0, times[-1] + 4.0 * GRID, GRID)
    rates = np.zeros(len(times))
    for rows, mode in spans(labels.modes, [slice(0, len(rates))]):
        if mode != STRAIGHT:
            rates[rows] = np.clip(np.mean(labels.rates[rows]), -0.1, 0.1)
    wanted = rates[np.searchsorted(times, grid, "right") - 1]
    speeds = np.interp(grid, times, np.clip(labels.speeds, 1.0, 400.0))
    smooth = np.convolve(np.pad(speeds, 30, mode="edge"), np.ones(61) / 61.0, "valid")
    name = f"twin of {flight.identity}"
    return fly(name, flight.tier, times, wanted, smooth, generator, FlightWorld())


def fly(
    identity: str,
    tier: Tier,
    times: FloatArray,
    wanted: FloatArray,
    speeds: FloatArray,
    generator: Generator,
    world: FlightWorld,
) -> Pair:
    """Simulate a flight with positions at times (n,), from 0 [s]. The turn rate that the pilot
    wants [rad/s] and the speeds [m/s], (g,), are those of every half second.
    """
    grid = GRID * np.arange(len(wanted))
    width = max(round(world.roll / GRID), 1)
    padded = np.pad(wanted, (width - 1, 0), mode="edge")
    rolled = np.convolve(padded, np.ones(width) / width, "valid")
    jitter = coloured(len(grid), world.jitter, world.jitter_time, generator)
    wander = coloured(len(grid), world.wander, world.wander_time, generator)
    rates = rolled * (1.0 + jitter) + wander
    path, moved = flown_path(rates, speeds, generator)
    scale = np.sqrt((world.freedom - 2.0) / world.freedom)
    when = times + scale * tier.timing * generator.standard_t(world.freedom, len(times))
    errors = scale * tier.across * generator.standard_t(world.freedom, (len(times), 2))
    positions = np.column_stack([np.interp(when, grid, axis) for axis in path.T]) + errors
    # Outside of the grid.
    before, after = np.minimum(when, 0.0), np.maximum(when - grid[-1], 0.0)
    positions += np.outer(before, moved[0] / GRID) + np.outer(after, moved[-1] / GRID)
    flight = Flight(identity, tier, times, positions)
    true_rates, speed = (np.interp(times, grid, values) for values in (rates, speeds))
    return flight, label_flight(flight, true_rates, speed, LabelRules())


def flown_path(
    rates: FloatArray, speeds: FloatArray, generator: Generator, wind: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return the path (g, 2) and its moves until the next row [m], in any first direction. From
    turn rates (g,) [rad/s], speeds (g,) and wind (g, 2) [m/s], every half second.
    """
    middle = generator.uniform(-np.pi, np.pi) + GRID * (np.cumsum(rates) - 0.5 * rates)
    moved = GRID * speeds[:, None] * np.column_stack([np.cos(middle), np.sin(middle)])
    moved += GRID * wind
    return np.cumsum(moved, axis=0) - moved, moved


def coloured(count: int, deviation: float, time: float, generator: Generator) -> FloatArray:
    """Return noise with an exponential autocorrelation (Ornstein-Uhlenbeck), (count,)."""
    kept = np.exp(-GRID / time)
    white = deviation * generator.standard_normal(count)
    white[1:] *= np.sqrt(1.0 - kept**2)
    return lfilter([1.0], [1.0, -kept], white)
