"""The posterior of the mode over every sequence of modes: nothing is merged, nothing is omitted.

Without process noise, and with a known start, such a sequence is one path, and its likelihood is
that of the errors of the measurements.
"""

import math

import numpy as np
from numpy.typing import NDArray

from hybrid_env import QuickestOptions

FloatArray = NDArray[np.float64]


def curvatures(options: QuickestOptions) -> FloatArray:
    """Return the curvature of every mode, (M,), positive to the left [1/m]."""
    inverse = 1.0 / np.array(options.radii)
    return np.concatenate([[0.0], inverse, -inverse])


def path_posteriors(
    options: QuickestOptions, measurements: FloatArray, smoothed: bool = False
) -> FloatArray:
    """Return the logarithms of the posteriors of the modes, (N, T, M), from measurements (N, T, 2)
    of objects without process noise, whose start is known but for the mode. Durations are
    geometric, so that the modes are a Markov chain. All M^T sequences of modes are paths. Smoothed,
    a posterior is given all measurements, else those up to its tick.
    """
    M = options.hypotheses
    turned = 1j * options.tau * options.speed * curvatures(options)
    rotation = np.exp(turned)
    # Displacement of a tick over the velocity before it.
    chord = np.full(M, options.tau, np.complex128)
    chord[1:] *= (rotation[1:] - 1.0) / turned[1:]
    position = np.zeros(1, np.complex128)
    velocity = np.array([options.speed * np.exp(1j * heading_of(options))])
    paths = []
    for _ in range(measurements.shape[1]):
        position = (position[:, None] + chord * velocity[:, None]).ravel()
        velocity = (velocity[:, None] * rotation).ravel()
        paths.append(position)
    points = measurements @ np.array([1.0, 1j])
    chain = np.log(options.transition_matrix)
    posteriors = np.empty((*points.shape, M))
    for track, of_track in enumerate(points):
        weights = np.full(M, -math.log(M))
        for tick, (position, point) in enumerate(zip(paths, of_track, strict=True)):
            if tick > 0:
                # The last mode of path k is k mod M.
                weights = (weights.reshape(-1, M, 1) + chain).ravel()
            error = position - point
            square = error.real**2 + error.imag**2
            weights = weights - 0.5 * square / options.variances[0]
            posteriors[track, tick] = sum_by_mode(weights.reshape(-1, M))
        for tick in range(len(paths) if smoothed else 0):
            of_tick = weights.reshape(M**tick, M, -1).swapaxes(1, 2)
            posteriors[track, tick] = sum_by_mode(of_tick.reshape(-1, M))
    return posteriors


def heading_of(options: QuickestOptions) -> float:
    """Return the heading at the start, which must be known [rad]."""
    assert options.heading is not None
    return options.heading


def sum_by_mode(logs: FloatArray) -> FloatArray:
    """Return the logarithms of the shares of the columns, (M,), of numbers with logarithms (n,
    M).
    """
    sums = np.exp(logs - logs.max()).sum(0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(sums / sums.sum()))
