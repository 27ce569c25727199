"""The law of the measurement noise in an environment, from its measurements alone.

The second differences of neighbouring measurements are mostly noise. Their histogram is compared with those of
simulated measurements under candidate laws, and the likeliest law is kept (indirect inference, Gourieroux, Monfort &
Renault 1993).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy import optimize

from agents.evaluation.task import Task
from baselines.rules import seeds
from baselines.rules.rollout import rollout
from hybrid_env.checks import FloatArray
from hybrid_env.noises import GaussianNoise, LevyNoise, Noise, OutlierNoise, StudentNoise
from hybrid_env.registration import make_track_vector_env

TRACKS, TICKS = 256, 100  # of the measurements
EDGES = np.concatenate([[0.0], np.geomspace(0.1, 1e6, 45), [np.inf]])
"""Of the bins of the histogram."""
LAWS: Mapping[type[Noise], tuple[tuple[float, float, float], ...]] = {
    OutlierNoise: ((0.05, 1e-3, 0.4), (5.0, 1.5, 100.0)),
    StudentNoise: ((3.0, 1.0, 100.0),),
    LevyNoise: ((1.6, 0.6, 1.99), (0.9, 0.05, 20.0), (50.0, 3.0, 1e5)),
}
"""First, smallest and largest value of each number of a law."""
STEP = 1.3  # factor to the first numbers that are tried beside those
TRIED = 40  # simulations for each law
NOT_NORMAL = 6.0  # likelihood-ratio statistic over its degrees of freedom up to which noise is normal; usually 3


def measured_noise(task: Task) -> Noise:
    """Return the likeliest law of the noise in an environment, from `TRACKS` x `TICKS` measurements."""
    seen = _histogram(task, task.options.noise, seeds.CHOOSING + TRACKS)

    def surprise(law: Noise) -> float:
        """Return the negative log-likelihood of the histogram, up to a constant."""
        expected = _histogram(task, law, seeds.CHOOSING) + 0.5
        return -float(seen @ np.log(expected / expected.sum()))

    normal: Noise = GaussianNoise()
    least = -float(seen @ np.log(np.maximum(seen, 1.0) / seen.sum()))
    found = [(surprise(normal), normal)]
    if 2.0 * (found[0][0] - least) < NOT_NORMAL * (np.count_nonzero(seen) - 1):
        return normal
    for kind, numbers in LAWS.items():
        first, low, high = np.log(numbers).T

        def law_of(point: FloatArray, kind: Any = kind) -> Noise:
            return kind(*np.exp(point).tolist())

        simplex = np.vstack([first, first + np.log(STEP) * np.eye(first.size)])
        best = optimize.minimize(
            lambda point: surprise(law_of(point)), first, method="Nelder-Mead", bounds=[*zip(low, high, strict=True)],
            options={"maxfev": TRIED, "initial_simplex": simplex, "xatol": 0.02, "fatol": 1.0},
        )  # fmt: skip
        found.append((float(best.fun), law_of(best.x)))
    return min(found, key=lambda one: one[0])[1]


def _histogram(task: Task, noise: Any, seed: int) -> FloatArray:
    """Return how many squared second differences, in units of R, fall into each bin of `EDGES`."""
    env = make_track_vector_env(task.env_id, TRACKS, tick_info=False, **{**task.given, "noise": noise})
    counts, last = np.zeros(EDGES.size - 1), np.full((2, TRACKS, 2), np.nan)
    for now in rollout(env, lambda rows: np.zeros(len(rows), np.int64), seed):
        last[:, now.starts] = np.nan
        measured = env.world.field("measurement")
        squared = ((measured - 2.0 * last[1] + last[0]) ** 2 / env.options.variances).sum(-1)
        counts += np.histogram(squared[np.isfinite(squared)], EDGES)[0]
        last = np.stack([last[1], measured])
        if now.step == TICKS:
            break
    return counts
