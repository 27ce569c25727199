"""Deciders for unknown switch moments by name: rules with thresholds to sweep, policies in run folders."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agents import learned
from agents.evaluation.deciders import SHIPPED, DeciderFamily, check_family, split_threshold
from baselines import (
    CusumDecider,
    GLRDecider,
    MeanRatioDecider,
    ShiryaevRobertsDecider,
    ThresholdDecider,
)
from baselines.rules.beam import BeamDecider
from baselines.rules.decider import Decider
from hybrid_env.checks import reject
from hybrid_env.durations import GeometricDurations
from hybrid_env.limits import MAX_LENGTH
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions

if TYPE_CHECKING:
    from agents.learned.statement_net import StatementNet
    from agents.learned.statement_policy import StatementPolicyDecider

PROBABILITIES = (
    *(0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95),
    *(0.98, 0.99, 0.999),
)
LOG_RATIOS = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 15.0)
LOG_RATIO_SUMS = (2.0, 3.0, 4.0, 4.5, 5.0, 5.5, 6.0, 6.5, 7.0, 7.5, 8.0, 9.0, 10.0, 12.0, 15.0)
RESTART_RATIOS = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # a filter for every start tick is slow
MARGINS = (-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0)
SMALLEST_BEAM = 64  # histories of switches
HISTORIES_PER_MODE = 16  # twice as many gain less than 0.001 of the share of right ticks with 7 hypotheses
SHIPPED_STATEMENTS = Path(learned.__file__).parent / "shipped_quickest"
"""Folder of the weights for unknown switch moments that come with the package."""
ALGORITHM = "statements"
"""Algorithm of a policy for unknown switch moments, on its card."""


def threshold_family(options: QuickestOptions) -> DeciderFamily:
    """Return the threshold on the probabilities of the bank."""
    return DeciderFamily("IMM threshold", "probability", _probabilities(options), 0.6, ThresholdDecider)


def beam_family(options: QuickestOptions) -> DeciderFamily:
    """Return the threshold on the posterior of switch histories with the true law of durations."""
    return _beam_family("beam", options, None)


def geometric_beam_family(options: QuickestOptions) -> DeciderFamily:
    """Return the beam that assumes a geometric law of the same mean, for which the age has no meaning."""
    mean = min(options.law.mean_duration, float(MAX_LENGTH))
    return _beam_family("beam, geometric", options, GeometricDurations(mean))


RULES: dict[str, Callable[[QuickestOptions], DeciderFamily]] = {
    "threshold": threshold_family,
    "cusum": lambda options: DeciderFamily("CUSUM", "G", LOG_RATIOS, 4.0, CusumDecider),
    "shiryaev-roberts": lambda options: DeciderFamily(
        "Shiryaev-Roberts", "ln R", LOG_RATIO_SUMS, 6.0, ShiryaevRobertsDecider
    ),
    "glr": lambda options: _restart_family("GLR", "ln GLR", options, GLRDecider),
    "detector-2020": lambda options: _restart_family("detector 2020", "ln lambda", options, MeanRatioDecider),
    "beam": beam_family,
    "beam-geometric": geometric_beam_family,
}
"""The classical rules by name, as families for the options of an environment."""


def _probabilities(options: QuickestOptions) -> tuple[float, ...]:
    """Return thresholds on the largest probability, which is never below 1 / M."""
    return tuple(p for p in PROBABILITIES if p == 0.0 or p > 1.0 / options.hypotheses)


def _beam_family(name: str, options: QuickestOptions, durations: GeometricDurations | None) -> DeciderFamily:
    branches = max(SMALLEST_BEAM, HISTORIES_PER_MODE * options.hypotheses)

    def make(threshold: float) -> Any:  # it observes measurements, see `record_statements`
        return BeamDecider(options, threshold, branches=branches, durations=durations)

    return DeciderFamily(name, "probability", _probabilities(options), 0.6, make)


def _restart_family(
    name: str, symbol: str, options: QuickestOptions, rule: type[GLRDecider | MeanRatioDecider]
) -> DeciderFamily:
    def make(threshold: float) -> Any:
        return rule(options, threshold)

    return DeciderFamily(name, symbol, RESTART_RATIOS, 5.0, make)


def statement_family(name: str, options: QuickestOptions) -> DeciderFamily:
    """Return the family of a classical rule, of the shipped agent or of a run folder, for an environment.

    Raises:
        ArgumentError: an unknown name, an unreadable run folder, or a policy for known switch moments.
    """
    if name in RULES:
        return RULES[name](options)
    folder = SHIPPED_STATEMENTS if name == SHIPPED else Path(name or os.devnull)
    if folder.is_dir():
        return learned_statement_family(SHIPPED if name == SHIPPED else folder.name, folder, options)
    known = [*RULES, *shipped_agents()]
    names = ", ".join(map(repr, known))
    raise reject("decider", name, f"{names} or the path of a run folder, each with an optional ':threshold'")


def shipped_agents() -> tuple[str, ...]:
    """Return the name of the agent that comes with the package, or nothing if there is none."""
    return (SHIPPED,) if SHIPPED_STATEMENTS.is_dir() else ()


def statement_policy_family(name: str, decider: "StatementPolicyDecider") -> DeciderFamily:
    """Return the family of a policy trained with PPO; its threshold is the log-odds margin of a change."""
    thresholds = tuple(margin for margin in MARGINS if margin >= 0.0)
    return DeciderFamily(name, "log-odds", thresholds, 0.0, decider.with_threshold, decider.hypotheses)


def statement_net_family(name: str, net: "StatementNet", options: QuickestOptions) -> DeciderFamily:
    """Return the family of an agent trained on its expected reward; see `StatementDecider`."""
    from agents.learned.statement_decider import StatementDecider

    return DeciderFamily(
        name, "log-odds", MARGINS, 0.0, lambda margin: StatementDecider(net, options, margin)
    )


def learned_statement_family(name: str, folder: Path, options: QuickestOptions) -> DeciderFamily:
    """Return the family of the policy in a run folder; its threshold is the log-odds margin of a change."""
    from agents.learned.policy_file import card_layout, load_policy

    weights, card = load_policy(folder)
    if card_layout(card) is not QuickestLayout:
        raise reject("decider", str(folder), "a policy for unknown switch moments")
    if card["recipe"]["entry"]["algo"] == ALGORITHM:
        from agents.learned.statement_decider import load_statements

        return statement_net_family(name, load_statements(folder, weights, card), options)
    from agents.learned.policy import load_actor
    from agents.learned.statement_policy import StatementPolicyDecider

    return statement_policy_family(name, StatementPolicyDecider(load_actor(folder, weights, card)))


def statement_decider(name: str, options: QuickestOptions) -> tuple[DeciderFamily, float, Decider]:
    """Return the family, the threshold and the decider for "threshold", "beam:0.7" or "runs/agent:1.5".

    Args:
        name: classical rule, 'shipped' or run folder, with an optional threshold after a colon.
        options: of the environment to decide in.

    Raises:
        ArgumentError: unknown name, a threshold that is not allowed, or a policy trained for another number
            of hypotheses.
    """
    base, threshold = split_threshold(name)
    family = statement_family(base, options)
    check_family(family, name, options)
    if threshold is None:
        threshold = family.default
    if not np.isfinite(threshold):
        raise reject("decider", name, "a finite number after the colon")
    return family, threshold, family.make(threshold)
