"""Simulated recordings: many runs of one scheme at once, for studies without an environment."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_env.checks import FloatArray, IntArray, check_array, check_integer, checked, reject
from hybrid_env.core.compilation import compiled, prepare
from hybrid_env.core.memory import BLOCK, LANES, PARAMETERS, SENSOR, aligned_zeros
from hybrid_env.core.noise import draw_failed
from hybrid_env.core.true_object import MODE, begin_motion, move
from hybrid_env.limits import Quantity, QuantityOrZero, axis_variances
from hybrid_env.modes import Mode, modes_of_radii, motion_table, planar_modes
from hybrid_env.noises import Noise, parse_noise
from hybrid_env.scheme import FixedScheme, parse_scheme, segment_table


@dataclass(frozen=True)
class Simulation:
    """n runs of T ticks in K segments.

    Attributes:
        truth: (n, T, 4) true states [x, vx, y, vy] [m, m/s].
        measurements: (n, T, 2) measured positions [m].
        lengths: (K,) segment lengths [ticks].
        signed_radii: (K,) turn radii [m], positive to the left, negative to the right, 0 for other
            modes.
        modes: (K,) places in the argument `modes`; without it 0 straight, 1 left, 2 right.
    """

    truth: FloatArray
    measurements: FloatArray
    lengths: IntArray
    signed_radii: FloatArray
    modes: IntArray


@compiled
def _simulate(
    blocks: Any,
    lengths: IntArray,
    table: FloatArray,
    motions: Any,
    options: Any,
    sensors: Any,
    truth: FloatArray,
    points: FloatArray,
) -> None:
    draws = np.empty((7, LANES))
    setting = options[0]
    for b in range(blocks.size):
        block = blocks[b]
        k = 0
        for segment in range(lengths.size):
            for lane in range(LANES):
                block.true_mode[lane] = np.int64(table[segment, MODE])
                begin_motion(block, lane, table[segment], motions, setting.tau)
            for _ in range(lengths[segment]):
                move(block, draws, np.uint64(0), np.uint64(LANES), sensors, motions, setting)
                for lane in range(LANES):
                    for axis in range(4):
                        truth[b * LANES + lane, k, axis] = block.truth[axis, lane]
                    for axis in range(2):
                        points[b * LANES + lane, k, axis] = block.measurement[axis, lane]
                k += 1


def simulate(
    scheme: str | FixedScheme,
    runs: int = 1,
    seed: int = 0,
    *,
    modes: str | Sequence[Mode | str] | None = None,
    start: ArrayLike = (0.0, 0.0, 0.0, 2.0),
    tau: float = 0.1,
    process_variance: float = 0.001,
    measurement_variance: float | ArrayLike = 0.1,
    noise: str | Noise = "gaussian",
) -> Simulation:
    """Simulate runs of a fixed scheme. Golubkov 2018, eq. (1); the default start is that of the
    papers.

    Args:
        scheme: a fixed scheme or its text.
        runs: n, number of runs.
        seed: seed of the random streams; run i of a seed does not depend on n.
        modes: the modes that the scheme names, as in the environments; None is straight motion and
            turns of any radius.
        start: (4,) true state [x, vx, y, vy] one tick before the first measurement [m, m/s].
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2].
        measurement_variance: R [m^2], one number or (x, y).
        noise: law of the measurement noise, see `hybrid_env.noises`.
    """
    fixed = parse_scheme(scheme)
    if not isinstance(fixed, FixedScheme):
        raise reject("scheme", scheme, "a fixed scheme")
    runs = check_integer("runs", runs)
    number = -(-runs // LANES)
    blocks = aligned_zeros((number,), BLOCK)
    sequence = np.random.SeedSequence(check_integer("seed", seed, minimum=0))
    streams = sequence.generate_state(4 * number * LANES, np.uint64)
    blocks["random_state"] = streams.reshape(number, LANES, 4).swapaxes(1, 2)
    blocks["truth"] = check_array("start", start, (4,))[:, None]
    named = planar_modes(modes)
    # Turns of any radius are modes of some radius in the table, which has their own.
    table = segment_table(fixed, named or modes_of_radii((1.0,)))
    lengths = np.array([piece.length for piece in fixed.pieces])
    truth = np.empty((number * LANES, lengths.sum(), 4))
    measurements = np.empty((number * LANES, lengths.sum(), 2))
    deviations = np.sqrt(axis_variances(measurement_variance))
    parameters = np.zeros(1, PARAMETERS)
    parameters["tau"] = checked("tau", tau, Quantity)
    variance = checked("process_variance", process_variance, QuantityOrZero)
    blocks["process_deviation"] = math.sqrt(variance)
    parameters["deviation_x"], parameters["deviation_y"] = deviations[[0, -1]]
    for name, value in parse_noise(noise).parameters().items():
        parameters[name] = value
    motions = None if named is None else motion_table(named, tau, variance)
    sensors = np.zeros(0, SENSOR)
    arguments = blocks, lengths, table, motions, parameters, sensors, truth, measurements
    prepare(_simulate, *arguments)
    _simulate(*arguments)
    if parameters["noise_failed"][0]:
        raise draw_failed()
    places = table[:, MODE].astype(np.int64)
    return Simulation(truth[:runs], measurements[:runs], lengths, table[:, 0], places)
