"""The law of the measurement noise in an environment, from its measurements alone.

Of the third differences of neighbouring measurements, noise is nearly everything. Their histogram
is compared with those of simulated measurements under candidate laws, and the likeliest law is kept
(a simulated likelihood, Diggle & Gratton 1984).
"""

import functools
import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from agents.evaluation.task import task_with
from baselines.rules import seeds
from baselines.rules.rollout import rollout
from hybrid_env.checks import FloatArray
from hybrid_env.noises import GaussianNoise, LevyNoise, Noise, OutlierNoise, StudentNoise
from hybrid_env.options import ModelOptions
from hybrid_env.registration import make_track_vector_env

# Tracks and ticks of the measurements.
TRACKS, TICKS = 256, 100
SEARCHED: dict[type[Noise], tuple[tuple[tuple[float, ...], float, float], ...]] = {
    OutlierNoise: (((0.01, 0.05, 0.2), 1e-3, 0.4), ((3.0, 10.0, 50.0, 200.0), 1.5, 1e3)),
    StudentNoise: (((1.5, 3.0, 10.0), 1.0, 100.0),),
    LevyNoise: (
        ((0.8, 1.2, 1.6), 0.5, 1.99),
        ((0.5, 1.0), 0.05, 20.0),
        ((50.0, 1e3, 1e5), 3.0, LevyNoise.clip),
    ),
}
"""Start values, lower and upper bound of each number of a law."""


@functools.lru_cache(64)
def measured_noise(options: ModelOptions) -> Noise:
    """Return the likeliest law of the noise in an environment, from `TRACKS` x `TICKS`
    measurements.
    """
    seen = _histogram(options, options.noise, seeds.MEASURING + TRACKS)

    def surprise(law: Noise) -> float:
        """Return the negative log-likelihood of the histogram, up to a constant."""
        expected = _histogram(options, law, seeds.MEASURING) + 0.5
        return -float(seen @ np.log(expected / expected.sum()))

    normal = GaussianNoise()
    # Too few differences count as normal.
    if seen.sum() < 1000:
        return normal
    least = -float(seen @ np.log(np.maximum(seen, 1.0) / seen.sum()))
    usual = surprise(normal)
    # The likelihood-ratio statistic per degree of freedom is about 6 for normal noise, as
    # neighbouring differences depend on each other, and the reference is simulated too.
    if 2.0 * (usual - least) <= 12.0 * (np.count_nonzero(seen) - 1):
        return normal
    candidates = [(usual, normal), *(_likeliest(kind, surprise) for kind in SEARCHED)]
    return min(candidates, key=lambda candidate: candidate[0])[1]


def _likeliest(kind: type[Noise], surprise: Callable[[Noise], float]) -> tuple[float, Noise]:
    """Return the smallest surprise of a kind of law, and the law."""
    # SciPy loads slowly.
    from scipy import optimize

    def law_of(point: FloatArray) -> Noise:
        return kind(*np.exp(point).tolist())

    starts, low, high = zip(*SEARCHED[kind], strict=True)
    first = min(itertools.product(*starts), key=lambda numbers: surprise(kind(*numbers)))
    simplex = np.log(first) + np.vstack([np.zeros(len(low)), np.log(1.3) * np.eye(len(low))])
    best = optimize.minimize(
        lambda point: surprise(law_of(point)),
        simplex[0],
        method="Nelder-Mead",
        bounds=[*zip(np.log(low), np.log(high), strict=True)],
        options={"maxfev": 60, "initial_simplex": simplex, "xatol": 0.02, "fatol": 1.0},
    )
    return float(best.fun), law_of(best.x)


def _histogram(options: ModelOptions, noise: Any, seed: int) -> FloatArray:
    """Return how many squared third differences, in units of R, fall into each bin of `edges`."""
    changed = {**vars(options), "noise": noise}
    env = make_track_vector_env(task_with(options).env_id, TRACKS, tick_info=False, **changed)
    # Weights of neighbouring measurements in a third difference.
    weights = np.array([-1.0, 3.0, -3.0, 1.0])
    # Edges of the bins of the histogram.
    edges = np.concatenate([[0.0], np.geomspace(1.0, 1e12, 73), [np.inf]])
    counts = np.zeros(edges.size - 1)
    last = np.full((weights.size, TRACKS, 2), np.nan)
    for now in rollout(env, lambda rows: np.zeros(len(rows), np.int64), seed):
        measured = env.world.field("measurement")
        # The row between two episodes.
        measured[now.terminated] = np.nan
        last = np.concatenate([last[1:], measured[None]])
        squared = (np.tensordot(weights, last, 1) ** 2 / env.options.variances).sum(-1)
        counts += np.histogram(squared[np.isfinite(squared)], edges)[0]
        if now.step == TICKS:
            break
    return counts
