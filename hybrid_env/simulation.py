"""Recordings of simulated objects, many runs of one scheme at once, for studies without an environment."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from hybrid_env.bank import noise_axes
from hybrid_env.checks import check_array, check_integer, check_positive, reject
from hybrid_env.kernel import move, turn
from hybrid_env.scheme import FixedScheme, parse_scheme
from hybrid_env.track import TRACK


@dataclass(frozen=True)
class Simulation:
    """n runs of T ticks in K pieces.

    Attributes:
        truth: (n, T, 4) states [x, vx, y, vy] [m, m/s].
        measurements: (n, T, 2) measured coordinates [m].
        lengths: (K,) ticks of the pieces.
        signed_radii: (K,) radii [m], positive to the left, negative to the right, 0 straight.
    """

    truth: NDArray[np.float64]
    measurements: NDArray[np.float64]
    lengths: NDArray[np.int64]
    signed_radii: NDArray[np.float64]


@njit(cache=True)
def _simulate(
    tracks: NDArray[Any],
    lengths: NDArray[np.int64],
    signed_radii: NDArray[np.float64],
    tau: float,
    process_deviation: float,
    deviations: NDArray[np.float64],
    truth: NDArray[np.float64],
    measurements: NDArray[np.float64],
) -> None:
    for i in range(tracks.size):
        k = 0
        for piece in range(lengths.size):
            turn(tracks[i], signed_radii[piece], tau)
            for _ in range(lengths[piece]):
                move(tracks[i], process_deviation, deviations[0], deviations[-1])
                truth[i, k] = tracks[i].truth
                measurements[i, k] = tracks[i].measurement
                k += 1


def simulate(
    scheme: str | FixedScheme,
    runs: int = 1,
    seed: int = 0,
    *,
    start: ArrayLike = (0.0, 0.0, 0.0, 2.0),
    tau: float = 0.1,
    process_variance: float = 0.001,
    measurement_variance: float | ArrayLike = 0.1,
) -> Simulation:
    """Draw runs of a fixed scheme from one starting state. Golubkov 2018, eq. (1), with the papers' x0.

    Args:
        scheme: fixed scheme or its text.
        runs: n; run i of a seed is the same whatever n is.
        start: (4,) true state one tick before the first measurement [m, m/s].
        tau: tick [s].
        process_variance: Q [m^2/s^2].
        measurement_variance: R [m^2], one number or (x, y).

    Raises:
        ArgumentError: names the argument, its value and what is allowed.
    """
    fixed = parse_scheme(scheme)
    if not isinstance(fixed, FixedScheme):
        raise reject("scheme", scheme, "a scheme of given segments, not a random one")
    runs = check_integer("runs", runs)
    tracks = np.zeros(runs, TRACK)
    sequence = np.random.SeedSequence(check_integer("seed", seed, minimum=0))
    streams = sequence.generate_state(4 * runs, np.uint64)
    tracks["random_state"] = streams.reshape(runs, 4)
    tracks["truth"] = check_array("start", start, (4,))
    lengths = np.array([piece.length for piece in fixed.pieces])
    signed_radii = np.array([piece.signed_radius for piece in fixed.pieces])
    truth = np.empty((runs, lengths.sum(), 4))
    measurements = np.empty((runs, lengths.sum(), 2))
    _simulate(
        tracks, lengths, signed_radii, check_positive("tau", tau),
        math.sqrt(check_positive("process_variance", process_variance, allow_zero=True)),
        np.sqrt(noise_axes(measurement_variance)), truth, measurements,
    )  # fmt: skip
    return Simulation(truth, measurements, lengths, signed_radii)
