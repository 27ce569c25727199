"""Forecasts of the position with their covariances, as long as the mode does not change."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation.mixture import mixture
from baselines.estimation.turns import begin_standing, begin_turn, turned_estimate
from hybrid_env.checks import FloatArray, Moments, PositiveOrZero, check_array, checked, reject
from hybrid_env.compiled import compiled, prepare, turn_coefficients


def forecast(
    estimate: ArrayLike,
    covariance: ArrayLike,
    probabilities: ArrayLike,
    model: Any,
    seconds: ArrayLike,
) -> Moments:
    """Return the means (k, 2) and the covariances (k, 2, 2) of the position after k times.

    The mode does not change. Each mode moves the estimate on along its straight line or circle, and
    the forecast has the mean and the covariance of their mixture: it includes the doubt about the
    mode. A mode that counts as certain has the probability 1.

    Args:
        estimate: (4,) [x, vx, y, vy] [m, m/s].
        covariance: (4, 4) of the estimate.
        probabilities: (M,) of the modes. A mode that is no turn of a radius and no stop counts as
            straight motion.
        model: the options of an environment or the model of a recording, with `all_modes`, the tick
            `tau` [s] and Q, `process_variance`.
        seconds: (k,) times ahead [s].

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """
    mean = check_array("estimate", estimate, (4,))
    matrix = check_array("covariance", covariance, (4, 4))
    weights = check_array("probabilities", probabilities, (len(model.all_modes),))
    if (weights < 0.0).any() or weights.sum() <= 0.0:
        raise reject("probabilities", weights, "at least 0, and not all 0")
    modes = []
    for mode in model.all_modes:
        curvature = 1.0 / mode.signed_radius if mode.signed_radius else 0.0
        stands = mode.type == "stop"
        modes.append(
            begin_standing(mean, matrix) if stands else begin_turn(mean, matrix, curvature, 0.0)
        )
    return forecast_turns(weights, modes, model, seconds)


def check_times(seconds: ArrayLike) -> FloatArray:
    """Return times ahead as an array (k,); `ArgumentError` if one is negative or not finite."""
    times = check_array("seconds", seconds, (None,))
    for time in times.tolist():
        checked("seconds", time, PositiveOrZero)
    return times


def forecast_turns(
    weights: FloatArray, turns: list[Moments], model: Any, seconds: ArrayLike
) -> Moments:
    """Return means (k, 2) and covariances (k, 2, 2) of the position after k times. weights: (m,) of
    m modes of motion, whose states (7,) and covariances (7, 7) are those of `turns`.
    """
    times = check_times(seconds)
    share = np.broadcast_to(weights / weights.sum(), (len(times), 1, len(turns)))
    means = np.empty((len(turns), len(times), 2))
    covariances = np.empty((len(turns), len(times), 2, 2))
    for mode, moments in enumerate(turns):
        to = means[mode], covariances[mode]
        arguments = *moments, times, model.tau, model.process_variance, *to
        prepare(_forecast, *arguments)
        _forecast(*arguments)
    mean, covariance = mixture(means.swapaxes(0, 1), covariances.swapaxes(0, 1), share)
    return mean[:, 0], covariance[:, 0]


@compiled
def _forecast(
    state: FloatArray,
    covariance: FloatArray,
    times: FloatArray,
    tau: float,
    process_variance: float,
    means: FloatArray,
    covariances: FloatArray,
) -> None:
    """Write means (k, 2) and covariances (k, 2, 2) of the position of a turn after k times."""
    rate = state[6]
    for k in range(times.size):
        moved, predicted = turned_estimate(state, covariance, times[k])
        means[k] = moved[:2]
        covariances[k] = predicted[:2, :2]
        # A velocity moves the position by its integral, from the tick of its noise on.
        for tick in range(1, int(times[k] / tau + 1e-9) + 1):
            rest = times[k] - tick * tau
            integral = rest * turn_coefficients(rate * rest)[2]
            covariances[k, 0, 0] += process_variance * integral**2
            covariances[k, 1, 1] += process_variance * integral**2
