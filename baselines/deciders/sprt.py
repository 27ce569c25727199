"""Wald's sequential probability ratio test over a bank of hypotheses, as in Golubkov 2018, rule (5).

Every hypothesis i is tested against the active one q_A, the mode decided last:
lambda_i = ln p(innovations | H_i) - ln p(innovations | H_qA). The print speaks of any lambda_ij; its
algorithm, and this file, compare with q_A only.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.deciders.decider import Actions, Observations
from hybrid_env.checks import check_between, reject
from hybrid_env.core.compilation import compiled
from hybrid_env.observation import LOG_FLOOR, Layout

CLIPPED = LOG_FLOOR + 1e-3


def sprt_thresholds(alpha: float, beta: float | None = None) -> tuple[float, float]:
    """Wald's bounds A = ln((1 - beta) / alpha) and B = ln(beta / (1 - alpha)). Golubkov 2018, after rule (5).

    Args:
        alpha: error of the first kind, in (0, 1).
        beta: error of the second kind, in (0, 1), alpha + beta < 1; None takes alpha.
    """
    alpha = check_between("alpha", alpha, 0.0, 1.0)
    if beta is None:
        beta = check_between("alpha", alpha, 0.0, 0.5)
    beta = check_between("beta", beta, 0.0, 1.0)
    if alpha + beta >= 1.0:
        raise reject("alpha + beta", alpha + beta, "a sum below 1")
    return math.log((1.0 - beta) / alpha), math.log(beta / (1.0 - alpha))


@compiled
def sprt_test(
    log_likelihood: NDArray[np.float64],
    running: NDArray[np.bool_],
    reference: int,
    upper: float,
    lower: float,
) -> int:
    """One tick of the test. Golubkov 2018, rule (5) and algorithm 1, lines 10 and 11.

    Args:
        log_likelihood: (M,) cumulative since the switch, up to a common constant.
        running: (M,) hypotheses still under test; those at or below `lower` are dropped in place.
        reference: the active hypothesis q_A.
        upper: A; of several ratios at or above it the largest wins.
        lower: B.

    Returns:
        The decided hypothesis, q_A itself where all others are dropped, or -1 to go on.
    """
    winner = -1
    largest = upper
    left = 0
    for h in range(log_likelihood.size):
        if h == reference or not running[h]:
            continue
        ratio = log_likelihood[h] - log_likelihood[reference]
        if ratio >= largest and (winner < 0 or ratio > largest):
            winner = h
            largest = ratio
        if ratio <= lower:
            running[h] = False
        else:
            left += 1
    if winner >= 0:
        return winner
    return -1 if left else reference


@compiled
def _test_tracks(
    log_likelihood: NDArray[np.float64],
    reference: NDArray[np.int64],
    running: NDArray[np.bool_],
    upper: float,
    lower: float,
    actions: NDArray[np.int64],
) -> None:
    for i in range(reference.size):
        actions[i] = sprt_test(log_likelihood[i], running[i], reference[i], upper, lower) + 1


class SPRTDecider:
    """The test of ATE as a decider on observations.

    The ratios in the observation are taken to the best hypothesis and clipped, and the best may be one that
    the test has dropped; so where a ratio is clipped, the decider adds up the log-likelihood itself, from
    innovations and their variances. What is left of a difference to `ate.track` is a ratio within float32's
    resolution of a threshold.

    Args:
        alpha: error of the first kind.
        beta: error of the second kind; None takes alpha.
    """

    def __init__(self, alpha: float = 1e-3, beta: float | None = None):
        self.upper, self.lower = sprt_thresholds(alpha, beta)

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, tuple[NDArray[np.float64], NDArray[np.bool_]]]:
        """See `Decider.predict`; the state is (log-likelihoods, hypotheses still under test), both (N, M).

        Without a state in the middle of a segment it begins with the clipped ratios and all hypotheses.
        """
        layout = Layout.of_rows(observation)
        along, across = (layout.read(observation, f"innovation_{way}") for way in ("along", "across"))
        increment = -layout.read(observation, "log_variance") - 0.5 * (along**2 + across**2)
        ratios = layout.read(observation, "log_ratio")
        log_likelihood, running = ratios, np.ones(ratios.shape, np.bool_)
        if state is not None:
            best = ratios.argmax(-1)[:, None]
            added = state[0] + increment
            log_likelihood = np.take_along_axis(added, best, -1) + ratios
            clipped = ratios <= CLIPPED
            log_likelihood[clipped] = added[clipped]
            running = state[1].copy()
        first = np.rint(layout.read(observation, "ticks")) <= 1
        log_likelihood[first] = increment[first]
        running[first] = True
        reference = layout.read(observation, "previous").argmax(-1)
        actions = np.empty(len(observation), np.int64)
        _test_tracks(log_likelihood, reference, running, self.upper, self.lower, actions)
        return actions, (log_likelihood, running)
