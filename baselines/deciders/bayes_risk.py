"""Optimal stopping on the posterior: declare when what one more tick may teach is not worth its cost.

The state of the decision is the doubt, the posterior of all that would make a declaration wrong, and the
tick. The boundary between waiting and declaring comes from simulated segments by backward induction, with
the values of both regressed on the doubt (least-squares Monte Carlo: Longstaff & Schwartz 2001). It looks at
one segment at a time: that a wrong decision spoils the next anchor is not in it.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from baselines.deciders.decider import Actions, Observations
from baselines.deciders.msprt import read_error_probability
from baselines.deciders.waited_paths import Paths
from hybrid_env.checks import check_array, check_choice, check_positive, reject
from hybrid_env.observation import LOG_FLOOR, Layout

FloatArray = NDArray[np.float64]
KNOTS = np.array([-20.0, -12.0, -8.0, -6.0, -4.5, -3.5, -2.5, -1.8, -1.2, -0.7, -0.3])  # of the log-doubt
RIDGE = 1e-6  # of the regression, in units of its weights' squares a path
LEAST_PATHS = 200  # a regression on fewer says nothing
SMOOTHING = 5  # ticks of its running median


def stopping_boundary(paths: Paths, delay_cost: float) -> FloatArray:
    """The largest log-doubt at which to declare, (T,) by tick, for a reward of +-1 and a cost a tick.

    Backward induction: the value of waiting is that of the best that follows less the cost of a tick, the
    value of declaring +1 or -1; their difference is regressed on the doubt over all paths that reach the
    tick.
    """
    delay_cost = check_positive("delay_cost", delay_cost, allow_zero=True)
    last = paths.doubt.shape[1]
    value = np.zeros(len(paths.length))
    if len(paths.length) < 5 * LEAST_PATHS:
        raise reject("paths", len(paths.length), f"at least {5 * LEAST_PATHS} segments to fit a rule on")
    boundary = np.zeros(last)
    grid = np.linspace(LOG_FLOOR, 0.0, 601)
    for k in range(last - 1, -1, -1):
        alive = paths.length > k
        ending = paths.length == k + 1
        declared = np.where(paths.right[:, k], 1.0, -1.0)
        value[alive] -= delay_cost  # of the tick that follows
        value[ending] = declared[ending]
        running = alive & ~ending
        if running.sum() < LEAST_PATHS:
            boundary[k] = 0.0  # few segments are that long, and soon end
        else:
            doubt = paths.doubt[running, k]
            # what declaring gains over waiting, where there are paths to say so
            gain = _regress(_design(doubt), declared[running] - value[running])
            inside = grid[grid >= np.quantile(doubt, 0.02)]
            waits = np.flatnonzero(_design(inside) @ gain < 0.0)
            if waits.size:
                boundary[k] = inside[waits[0] - 1] if waits[0] else LOG_FLOOR
            else:
                boundary[k] = 0.0
        declares = running & (paths.doubt[:, k] <= boundary[k])
        value[declares] = declared[declares]
    return _smooth(boundary)


def _design(doubt: FloatArray) -> FloatArray:
    """Piecewise linear functions of the log-doubt between the knots, and of the doubt itself."""
    hats = [np.maximum(doubt - knot, 0.0) for knot in KNOTS]
    return np.stack([np.ones_like(doubt), np.exp(doubt), *hats], axis=-1)


def _regress(design: FloatArray, target: FloatArray) -> FloatArray:
    scale = np.sqrt((design**2).mean(0)) + 1e-12
    scaled = design / scale
    normal = scaled.T @ scaled + RIDGE * len(target) * np.eye(design.shape[1])
    return np.asarray(np.linalg.solve(normal, scaled.T @ target) / scale)


def _smooth(boundary: FloatArray) -> FloatArray:
    """The running median, which the noise of single regressions does not reach."""
    padded = np.pad(np.maximum(boundary, LOG_FLOOR), SMOOTHING // 2, mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, SMOOTHING), axis=-1))


class BayesRiskDecider:
    """Declares when the doubt falls to the boundary of the tick.

    Args:
        boundary: (T,) log-doubt by tick, from `stopping_boundary`; later ticks take the last.
        by: what must be right, as in the paths that it was fitted on.
    """

    def __init__(self, boundary: FloatArray, by: Literal["hypothesis", "type"] = "hypothesis"):
        self.boundary = check_array("boundary", boundary, (None,))
        check_choice("by", by, ("hypothesis", "type"))
        self.by: Literal["hypothesis", "type"] = by

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, None]:
        """See `Decider.predict`; there is no state."""
        layout = Layout.of_rows(observation)
        ticks = np.rint(layout.read(observation, "ticks")).astype(np.int64)
        doubt, best = read_error_probability(observation, self.by)
        limit = self.boundary[np.clip(ticks - 1, 0, self.boundary.size - 1)]
        return np.where(doubt <= limit, best + 1, 0), None
