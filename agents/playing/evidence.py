"""The evidence of a decider: the quantity that it compares with its threshold, for the evidence panel."""

import copy
import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.spaces import Discrete
from numpy.typing import NDArray
from scipy.special import expit, logit

from baselines import GapDecider, MSPRTDecider, SPRTDecider
from baselines.rules.bayes_risk import BayesRiskDecider
from baselines.rules.decider import Decider, Observations
from baselines.rules.msprt import mode_types, type_sums
from hybrid_env.observation import Layout
from hybrid_env.rendering.evidence import EvidencePanel, Threshold, ratio_limits, sprt_panel

if TYPE_CHECKING:
    from agents.learned.anchor_decider import AnchorDecider

FloatArray = NDArray[np.float64]
EvidenceFunction = Callable[[Observations, Any, NDArray[np.bool_]], FloatArray]
POSTERIOR_LIMIT = 0.001  # lower limit of the axis of posterior probabilities, unless a threshold needs more
AXIS_MARGIN = 1.15  # limit of an axis, relative to the threshold


@dataclass(frozen=True)
class DeciderEvidence:
    """The evidence of a decider.

    Attributes:
        panel: description of the evidence panel.
        compute: returns the evidence for each hypothesis, (1, M). It takes the arguments of
            `Decider.predict` at the same tick: observation (1, 6 M + 10), state and episode_start (1,).
    """

    panel: EvidencePanel
    compute: EvidenceFunction


def decider_evidence(decider: Decider) -> DeciderEvidence:
    """Return the evidence of a classical or learned decider.

    Without a threshold on evidence, as with `FixedTimeDecider`, it is the posterior of the Kalman filters.
    """
    match decider:
        case SPRTDecider():
            lower, upper = math.exp(decider.lower), math.exp(decider.upper)
            alpha = (1.0 - lower) / (upper - lower)  # Wald's thresholds solved for alpha
            return DeciderEvidence(
                sprt_panel(alpha),
                lambda observation, state, start: ratios_to_active(
                    observation, decider.predict(observation, state, start)[1][0]
                ),
            )
        case GapDecider():
            panel = EvidencePanel(
                label="log-likelihood ratio to the best other mode",
                limits=ratio_limits(decider.gap),
                thresholds=(Threshold(np.array([decider.gap])),),
                legend=f"gap {decider.gap:g}",
            )
            return DeciderEvidence(panel, lambda observation, state, start: ratios_to_best_other(observation))
        case MSPRTDecider():
            by_type = decider.by == "type"
            panel = posterior_panel("Kalman filters", by_type, np.array([decider.alpha]))
            return DeciderEvidence(
                panel, lambda observation, state, start: bank_posterior(observation, by_type)
            )
        case BayesRiskDecider():
            by_type = decider.by == "type"
            panel = posterior_panel("Kalman filters", by_type, np.exp(decider.boundary))
            return DeciderEvidence(
                panel, lambda observation, state, start: bank_posterior(observation, by_type)
            )
        case _:
            return learned_evidence(decider)


def learned_evidence(decider: Decider) -> DeciderEvidence:
    """Return the evidence of a learned decider. PyTorch is imported only here, because it loads slowly."""
    from agents.learned.anchor_decider import AnchorDecider
    from agents.learned.policy import PolicyDecider

    match decider:
        case AnchorDecider():
            by_type = decider.by_type
            panel = posterior_panel("learned anchors", by_type, np.array([decider.alpha]))
            return DeciderEvidence(panel, functools.partial(anchor_evidence, decider))
        case PolicyDecider():
            return DeciderEvidence(
                log_odds_panel(decider.threshold, single=decider.policy.action_space == Discrete(2)),
                lambda observation, state, start: log_odds_evidence(
                    decider.logits(observation, state, start)[0], observation
                ),
            )
        case _:
            return DeciderEvidence(
                posterior_panel("Kalman filters", by_type=False),
                lambda observation, state, start: bank_posterior(observation, by_type=False),
            )


def posterior_panel(source: str, by_type: bool, alpha: FloatArray | None = None) -> EvidencePanel:
    """Return the panel of posterior probabilities with the threshold 1 - alpha.

    Args:
        source: of the posterior.
        by_type: show one curve for each type of motion instead of one for each hypothesis.
        alpha: (T,) threshold on the posterior error probability at each tick; None draws no threshold.
    """
    limit = 1.0 - POSTERIOR_LIMIT
    thresholds: tuple[Threshold, ...] = ()
    legend = ""
    if alpha is not None:
        thresholds = (Threshold(1.0 - alpha),)
        legend = f"1 - alpha at alpha = {alpha[0]:g}" if len(alpha) == 1 else "stopping boundary"
        limit = max(limit, expit(AXIS_MARGIN * logit(1.0 - alpha.max())))
    return EvidencePanel(
        label=f"posterior probability ({source})",
        limits=(1.0 - limit, limit),
        scale="logit",
        curves="type" if by_type else "hypothesis",
        thresholds=thresholds,
        legend=legend,
    )


def log_odds_panel(threshold: float, single: bool) -> EvidencePanel:
    """Return the panel of the log-odds of declaring; `single` shows one curve for all hypotheses."""
    return EvidencePanel(
        label="log-odds of declaring against waiting",
        limits=(threshold - 15.0, threshold + 5.0),
        curves="single" if single else "hypothesis",
        thresholds=(Threshold(np.array([threshold])),),
        legend=f"threshold {threshold:g}",
    )


def ratios_to_active(observation: Observations, log_likelihood: FloatArray) -> FloatArray:
    """Return the log-likelihood ratio of each hypothesis to the active mode, (N, M)."""
    active = Layout.of_rows(observation).read(observation, "previous").argmax(-1)
    return log_likelihood - np.take_along_axis(log_likelihood, active[:, None], axis=-1)


def ratios_to_best_other(observation: Observations) -> FloatArray:
    """Return the log-likelihood ratio of each hypothesis to the most likely of all others, (N, M)."""
    log_ratio = Layout.of_rows(observation).read(observation, "log_ratio")
    second, first = np.partition(log_ratio, -2, axis=-1)[:, -2:].T
    is_best = np.arange(log_ratio.shape[1]) == log_ratio.argmax(-1)[:, None]
    return log_ratio - np.where(is_best, second[:, None], first[:, None])


def bank_posterior(observation: Observations, by_type: bool) -> FloatArray:
    """Return the posterior of the Kalman filters under equal priors, (N, M)."""
    log_ratio = Layout.of_rows(observation).read(observation, "log_ratio")
    return posterior_evidence(np.exp(log_ratio), by_type)


def posterior_evidence(posterior: NDArray[np.floating], by_type: bool) -> FloatArray:
    """Return the normalised posterior of each hypothesis or of its type, (N, M), from (N, M)."""
    hypotheses = posterior.shape[-1]
    values = type_sums(posterior)[:, mode_types(hypotheses)] if by_type else posterior.astype(np.float64)
    return values / posterior.sum(-1, dtype=np.float64, keepdims=True)


def anchor_evidence(
    decider: "AnchorDecider", observation: Observations, state: Any, start: NDArray[np.bool_]
) -> FloatArray:
    """Return the posterior of each hypothesis or of its type, (N, M), for the best one 1 - expected loss."""
    # a copy, because the decider changes its state in place
    posterior, state = decider.posterior(observation, copy.deepcopy(state), start)
    error, best = decider.errors(observation, posterior, state)
    values = posterior_evidence(posterior, decider.by_type)
    if decider.by_type:
        types = mode_types(posterior.shape[1])
        return np.where(types == types[best][:, None], 1.0 - error[:, None], values)
    return values


def log_odds_evidence(logits: FloatArray, observation: Observations) -> FloatArray:
    """Return the log-odds of declaring each hypothesis against waiting, (N, M), from logits (N, actions)."""
    hypotheses = Layout.of_rows(observation).hypotheses
    return np.broadcast_to(logits[:, 1:] - logits[:, :1], (len(logits), hypotheses))
