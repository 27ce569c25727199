"""Optimal stopping of the posterior: declare when one more observation is not worth its cost.

The state is the tick and the posterior error probability of the best declaration. The stopping
boundary comes from simulated segments by backward induction: the values of declaring and of waiting
are regressed on the error probability (Longstaff & Schwartz 2001, "Valuing American options by
simulation"). That a wrong decision spoils the next anchor is ignored.
"""

import functools

import numpy as np

from baselines.rules.decider import Decider, DeciderFamily
from baselines.rules.msprt import PosteriorRule, rewarded
from baselines.rules.posterior_paths import PosteriorPaths, simulate_posterior_paths
from baselines.rules.seeds import FITTING
from hybrid_env.checks import FloatArray, check_positive, reject
from hybrid_env.core.observation_row import LOG_FLOOR
from hybrid_env.options import WorldOptions

# Log error probabilities.
KNOTS = np.array([-20.0, -12.0, -8.0, -6.0, -4.5, -3.5, -2.5, -1.8, -1.2, -0.7, -0.3])
# Ridge penalty of the regression, per path and for columns of unit root mean square.
RIDGE = 1e-6
# Ticks that fewer paths reach are not regressed.
MIN_PATHS = 200
# Window of the running median over the boundary [ticks].
SMOOTHING = 5
FITTING_EPISODES = 3000
# Thresholds over the delay cost.
COST_FACTORS = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0)


def stopping_boundary(paths: PosteriorPaths, delay_cost: float) -> FloatArray:
    """Return the largest log error probability at which to declare, (T,) by tick. A correct
    declaration is worth +1, a wrong one -1; waiting is worth the best value of the next tick less
    the cost of a tick. The difference of the two is regressed over all paths that reach the tick.
    """
    delay_cost = check_positive("delay_cost", delay_cost, allow_zero=True)
    if len(paths.length) < 5 * MIN_PATHS:
        raise reject(
            "paths",
            len(paths.length),
            f"at least {5 * MIN_PATHS} segments to fit a boundary",
        )
    value = np.zeros(len(paths.length))
    boundary = np.zeros(paths.log_error_probability.shape[1])
    grid = np.linspace(LOG_FLOOR, 0.0, 601)
    for k in reversed(range(boundary.size)):
        alive = paths.length > k
        ending = paths.length == k + 1
        declared = np.where(paths.correct[:, k], 1.0, -1.0)
        # Cost of the next tick.
        value[alive] -= delay_cost
        value[ending] = declared[ending]
        running = alive & ~ending
        # The others are few, and end soon.
        if running.sum() >= MIN_PATHS:
            log_error_probability = paths.log_error_probability[running, k]
            # Advantage of declaring over waiting, evaluated only in the range that the paths cover.
            gain = _ridge_regression(
                _basis_functions(log_error_probability),
                declared[running] - value[running],
            )
            inside = grid[grid >= np.quantile(log_error_probability, 0.02)]
            waits = np.flatnonzero(_basis_functions(inside) @ gain < 0.0)
            if waits.size:
                boundary[k] = inside[waits[0] - 1] if waits[0] else LOG_FLOOR
        declares = running & (paths.log_error_probability[:, k] <= boundary[k])
        value[declares] = declared[declares]
    # The running median removes the noise of single regressions.
    padded = np.pad(np.maximum(boundary, LOG_FLOOR), SMOOTHING // 2, mode="edge")
    return np.asarray(
        np.median(np.lib.stride_tricks.sliding_window_view(padded, SMOOTHING), axis=-1)
    )


def _basis_functions(log_error_probability: FloatArray) -> FloatArray:
    """Return a constant, the error probability, and piecewise linear functions of its logarithm,
    (N, F).
    """
    hinges = [np.maximum(log_error_probability - knot, 0.0) for knot in KNOTS]
    return np.stack(
        [np.ones_like(log_error_probability), np.exp(log_error_probability), *hinges],
        axis=-1,
    )


def _ridge_regression(design: FloatArray, target: FloatArray) -> FloatArray:
    """Return (F,) coefficients for a design (N, F) and a target (N,)."""
    scale = np.sqrt((design**2).mean(0)) + 1e-12
    scaled = design / scale
    normal = scaled.T @ scaled + RIDGE * len(target) * np.eye(design.shape[1])
    return np.asarray(np.linalg.solve(normal, scaled.T @ target) / scale)


class BayesRiskDecider(PosteriorRule):
    """Declares when the log error probability falls to the limit of the tick, from
    `stopping_boundary`.
    """

    name = "bayes"
    title = "Bayes risk"
    symbol = "cost"
    colour = "#780f3c"
    marker = "h"

    @classmethod
    def family(cls, options: WorldOptions) -> DeciderFamily:
        """Return the rule fitted to an environment; its threshold is the delay cost of the fit."""
        paths = functools.cache(
            lambda: simulate_posterior_paths(FITTING_EPISODES, FITTING, **vars(options))
        )

        @functools.cache
        def make(cost: float) -> Decider:
            check_positive("cost", cost, allow_zero=True)
            return cls(stopping_boundary(paths(), cost), rewarded(options))

        cost = options.delay_cost or 0.01
        thresholds = tuple(factor * cost for factor in reversed(COST_FACTORS))
        return DeciderFamily(cls.title, cls.symbol, thresholds, cost, make)
