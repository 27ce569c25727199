"""Wald's sequential probability ratio test (SPRT) over a bank of hypotheses. Golubkov 2018, rule
(5): every hypothesis i is tested against the active hypothesis q_A, the last decided mode, with the
log-likelihood ratio lambda_i = ln p(innovations | H_i) - ln p(innovations | H_qA). Rule (5) uses
all pairs lambda_ij; the algorithm of the paper only these. Its error probabilities hold for each
hypothesis against the active one: where a third one is true, errors can be much more frequent, and
`msprt` bounds them all.
"""

import math
from functools import partial
from typing import Any, ClassVar

import numpy as np

from baselines.rules.decider import Actions, Decider, Observations, Variants
from baselines.rules.msprt import PUBLISHED, ROBUST, at_floor
from hybrid_env.checks import BoolArray, FloatArray, IntArray, Probability, checked, reject
from hybrid_env.compiled import compiled, internal, run_compiled
from hybrid_env.observation import Layout
from hybrid_env.rendering.evidence import EvidencePanel, sprt_panel


def sprt_thresholds(alpha: float, beta: float | None = None) -> tuple[float, float]:
    """Return Wald's thresholds A = ln((1 - beta) / alpha) and B = ln(beta / (1 - alpha)).

    Golubkov 2018, after rule (5).

    Args:
        alpha: type I error probability, in (0, 1).
        beta: type II error probability, in (0, 1), with alpha + beta < 1; None uses alpha.
    """
    alpha = checked("alpha", alpha, Probability)
    beta = alpha if beta is None else checked("beta", beta, Probability)
    if alpha + beta >= 1.0:
        raise reject("alpha + beta", alpha + beta, "a sum below 1")
    return math.log((1.0 - beta) / alpha), math.log(beta / (1.0 - alpha))


@internal
def sprt_test(
    log_likelihood: FloatArray, running: BoolArray, reference: int, upper: float, lower: float
) -> int:
    """Perform the test at one tick. Golubkov 2018, rule (5) and algorithm 1, lines 10 and 11.

    Rejects hypotheses with a ratio <= the threshold B `lower` in place. Returns the one with the
    largest ratio >= the threshold A `upper`, the `reference` q_A if all others are rejected, or -1
    to continue the test.

    Args:
        log_likelihood: (M,) cumulative log-likelihoods since the switch, up to a common constant.
        running: (M,) True for hypotheses not yet rejected.
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
    log_likelihood: FloatArray,
    reference: IntArray,
    running: BoolArray,
    upper: float,
    lower: float,
    actions: IntArray,
) -> None:
    for i in range(reference.size):
        actions[i] = sprt_test(log_likelihood[i], running[i], reference[i], upper, lower) + 1


class SPRTDecider(Decider):
    """The test of ATE on the rows of the environment, whatever its bank.

    ATE itself, the algorithm of the paper, is the test on the published bank, where every
    declaration counts.

    The ratios in an observation refer to the most likely hypothesis, which the test may have
    rejected, and they are clipped. Where a ratio is clipped, the decider accumulates the
    log-likelihood from the innovations and their variances. Its decisions differ from `ate.track`
    only where a ratio is within float32 precision of a threshold.

    Args:
        alpha: type I error probability of each hypothesis against the active one.
        beta: type II error probability of the same; None uses alpha.
    """

    name = "sprt"
    title = "SPRT"
    symbol = "alpha"
    default = 1e-3
    thresholds = (
        0.3,
        0.2,
        0.15,
        0.1,
        0.07,
        0.05,
        0.03,
        0.02,
        0.015,
        0.01,
        7e-3,
        5e-3,
        3e-3,
        2e-3,
        1e-3,
        5e-4,
        3e-4,
        1e-4,
        3e-5,
        1e-5,
        3e-6,
        1e-6,
        1e-7,
        1e-8,
        1e-9,
        1e-10,
    )
    second_threshold = "beta"
    variants: ClassVar[Variants] = {
        "ate": {"title": "ATE (SPRT)", "options": PUBLISHED},
        "ate-robust": {"title": "ATE (SPRT), robust", "options": ROBUST},
    }

    def __init__(self, alpha: float = 1e-3, beta: float | None = None):
        self.beta = beta
        super().__init__(alpha)

    def check_threshold(self, threshold: Any) -> float:
        """See `Decider.check_threshold`."""
        sprt_thresholds(threshold, self.beta)
        return float(threshold)

    def decide(
        self, observation: Observations, state: Any, episode_start: Any
    ) -> tuple[Actions, tuple[FloatArray, BoolArray, FloatArray]]:
        """See `Decider.decide`. The state is log-likelihoods and hypotheses not yet rejected, both
        (N, M), and ticks (N,).

        If there is no state after the first tick of a segment, the test starts from the clipped
        ratios with all hypotheses; so it does in each segment if a decision is asked for every few
        ticks.
        """
        read = partial(Layout.of_rows(observation).read, observation)
        along = read("innovation_along")
        across = read("innovation_across")
        ratios = read("log_ratio")
        ticks = np.rint(read("ticks"))
        increment = -read("log_variance") - 0.5 * (along**2 + across**2)
        log_likelihood = ratios
        running = np.ones(ratios.shape, bool)
        if state is not None:
            before, running, last = state
            running = running | (ticks <= last)[:, None]
            best = ratios.argmax(-1)[:, None]
            accumulated = before + increment
            goes_on = at_floor(ratios) & (ticks == last + 1)[:, None]
            log_likelihood = np.take_along_axis(accumulated, best, -1) + ratios
            log_likelihood = np.where(goes_on, accumulated, log_likelihood)
        first = ticks <= 1
        log_likelihood[first] = increment[first]
        reference = read("previous").argmax(-1)
        actions = np.empty(len(observation), np.int64)
        upper, lower = sprt_thresholds(self.threshold, self.beta)
        run_compiled(_test_tracks, log_likelihood, reference, running, upper, lower, actions)
        return actions, (log_likelihood, running, ticks)

    def panel(self) -> EvidencePanel:
        """Return the panel of `evidence`."""
        upper, lower = map(math.exp, sprt_thresholds(self.threshold, self.beta))
        # Wald's thresholds solved for alpha.
        return sprt_panel((1.0 - lower) / (upper - lower))

    def evidence(
        self, observation: Observations, state: Any = None, episode_start: Any = None
    ) -> FloatArray:
        """Return the log-likelihood ratio of each hypothesis to the active mode, (N, M)."""
        log_likelihood = self.decide(observation, state, episode_start)[1][0]
        active = Layout.of_rows(observation).read(observation, "previous").argmax(-1)
        return log_likelihood - np.take_along_axis(log_likelihood, active[:, None], axis=-1)
