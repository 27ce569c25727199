"""Deciders by name: the classical rules with the thresholds to sweep, and trained policies in run folders."""

import dataclasses
import functools
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from agents import learned
from agents.evaluation import seeds
from baselines import FixedTimeDecider, GapDecider, MSPRTDecider, SPRTDecider
from baselines.rules.anchor_prior import AnchorPrior
from baselines.rules.bayes_risk import BayesRiskDecider, stopping_boundary
from baselines.rules.decider import Decider
from baselines.rules.posterior_paths import PosteriorPaths, simulate_posterior_paths
from baselines.rules.refiltering import (
    CalibratedAnchorDecider,
    KeptCovarianceDecider,
    fit_calibrated_anchor,
)
from hybrid_env.checks import check_positive, reject
from hybrid_env.observation import Layout
from hybrid_env.options import ModelOptions, WorldOptions

if TYPE_CHECKING:
    from agents.learned.anchor_decider import AnchorNetworks
    from agents.learned.policy import PolicyDecider


@dataclass(frozen=True)
class DeciderFamily:
    """A decider with one threshold that trades decision time against accuracy.

    Attributes:
        name: shown in tables.
        symbol: of the threshold.
        thresholds: to sweep, in order of increasing decision time.
        default: threshold used when none is given.
        make: creates the decider at a threshold.
        hypotheses: number M of hypotheses that the decider requires; None applies to any.
        options: options of the environment in which the decider runs, if they differ: another bank that
            follows the same object.
    """

    name: str
    symbol: str
    thresholds: tuple[float, ...]
    default: float
    make: Callable[[float], Decider]
    hypotheses: int | None = None
    options: dict[str, Any] = field(default_factory=dict)


ATE = DeciderFamily(
    "ATE (SPRT)",
    "alpha",
    (
        *(0.3, 0.2, 0.15, 0.1, 0.07, 0.05, 0.03, 0.02, 0.015, 0.01, 7e-3, 5e-3, 3e-3, 2e-3, 1e-3),
        *(5e-4, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10),
    ),
    1e-3,
    SPRTDecider,
)
NO_EARLY_DECISION = 10_000_000  # ticks; longer than any segment
FIXED_TIME = DeciderFamily(
    "fixed time",
    "ticks",
    (5, 10, 15, 18, 20, 22, 24, 25, 26, 28, 30, 32, 34, 36, 40, 45, 50, 60, 80, 100),
    25,
    lambda ticks: FixedTimeDecider(int(ticks)),
)
ALPHAS = (
    *(0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.12, 0.1, 0.08, 0.06, 0.05, 0.04, 0.03, 0.02, 0.015, 0.01),
    *(5e-3, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10),
)
FEW_ALPHAS = (0.6, 0.4, 0.25, 0.15, 0.1, 0.08, 0.05, 0.03, 0.02, 0.01, 3e-3, 3e-4, 1e-5)
"""Some of `ALPHAS`, for deciders that are slow to evaluate, and for tables over many environments."""

MSPRT = DeciderFamily("MSPRT", "alpha", ALPHAS, 0.02, MSPRTDecider)
TYPE_MSPRT = DeciderFamily(
    "MSPRT of types", "alpha", ALPHAS, 0.02, lambda alpha: MSPRTDecider(alpha, by="type")
)
GAP = DeciderFamily(
    "gap rule",
    "gap",
    (0.2, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.6, 5.0, 5.5, 6.0, 7.0, 8.0, 10.0, 13.0, 17.0, 22.0, 28.0),
    4.6,
    GapDecider,
)
ML_AT_END = DeciderFamily("ML at the end", "ticks", (NO_EARLY_DECISION,), NO_EARLY_DECISION, FIXED_TIME.make)
CLASSICAL = {
    "ate": ATE,
    "fixed": FIXED_TIME,
    "msprt": MSPRT,
    "msprt-type": TYPE_MSPRT,
    "gap": GAP,
    "ml": ML_AT_END,
}
LOG_ODDS = (
    -10.0,
    -8.0,
    -6.0,
    -5.0,
    -4.0,
    -3.0,
    -2.0,
    -1.5,
    -1.0,
    -0.5,
    0.0,
    0.5,
    1.0,
    1.5,
    2.0,
    2.5,
    3.0,
    4.0,
)

BAYES = "bayes"
KEPT_COVARIANCE = "msprt-kept"
CALIBRATED_ANCHOR = "calibrated"
CALIBRATED_ROBUST = "calibrated-robust"
ANCHOR_AWARE = "msprt-aware"
ROBUST_ATE = "ate-robust"
ROBUST_MSPRT = "msprt-robust"
ROBUST_LIKELIHOOD = "student_t 50"
SHIPPED = "shipped"
SHIPPED_FOLDER = Path(learned.__file__).parent / "shipped"
COST_FACTORS = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0)  # times the delay cost
FITTING_EPISODES = 3000
CALIBRATION_EPISODES = 2000


def bayes_family(world: WorldOptions) -> DeciderFamily:
    """Return Bayes-risk stopping fitted to an environment; its threshold is the delay cost of the fit."""

    @functools.cache
    def paths() -> PosteriorPaths:
        return simulate_posterior_paths(FITTING_EPISODES, seeds.FITTING, **vars(world))

    @functools.cache
    def make(cost: float) -> Decider:
        check_positive("cost", cost, allow_zero=True)
        fitted = paths()
        return BayesRiskDecider(stopping_boundary(fitted, cost), fitted.by)

    cost = world.delay_cost or 0.01
    thresholds = tuple(factor * cost for factor in reversed(COST_FACTORS))
    return DeciderFamily("Bayes risk", "cost", thresholds, cost, make)


def kept_covariance_family(world: WorldOptions) -> DeciderFamily:
    """Return the MSPRT that starts the filters from the covariance of the estimate at the switch."""
    return DeciderFamily(
        "MSPRT, kept P", "alpha", ALPHAS, 0.02, lambda alpha: KeptCovarianceDecider(world, alpha)
    )


def calibrated_anchor_family(world: WorldOptions, robust: bool = False) -> DeciderFamily:
    """Return the MSPRT whose anchor distribution is fitted to simulated episodes of an environment.

    Args:
        world: options of the environment.
        robust: with the robust filters of the anchor agent, see `ComponentFilters`.
    """

    @functools.cache
    def prior() -> AnchorPrior:
        return fit_calibrated_anchor(world, CALIBRATION_EPISODES, seeds.FITTING, robust=robust)

    return DeciderFamily(
        "calibrated anchor, robust" if robust else "calibrated anchor",
        "alpha",
        ALPHAS,
        0.02,
        lambda alpha: CalibratedAnchorDecider(world, prior(), alpha, robust),
    )


def anchor_aware_family(world: WorldOptions) -> DeciderFamily:
    """Return the MSPRT of the anchor-aware bank, by what the environment rewards."""
    by: Literal["hypothesis", "type"] = "type" if world.correctness == "type" else "hypothesis"
    return DeciderFamily(
        "MSPRT, anchor-aware",
        "alpha",
        ALPHAS,
        0.02,
        lambda alpha: MSPRTDecider(alpha, by=by),
        options={"bank": "anchor_aware"},
    )


def robust_family(family: DeciderFamily, world: WorldOptions) -> DeciderFamily:
    """Return a classical rule on the published bank with the robust likelihood."""
    return dataclasses.replace(
        family, name=f"{family.name}, robust", options={"likelihood": ROBUST_LIKELIHOOD}
    )


FITTED: dict[str, Callable[[WorldOptions], DeciderFamily]] = {
    BAYES: bayes_family,
    KEPT_COVARIANCE: kept_covariance_family,
    CALIBRATED_ANCHOR: calibrated_anchor_family,
    CALIBRATED_ROBUST: functools.partial(calibrated_anchor_family, robust=True),
    ANCHOR_AWARE: anchor_aware_family,
    ROBUST_ATE: functools.partial(robust_family, ATE),
    ROBUST_MSPRT: functools.partial(robust_family, MSPRT),
}
"""Rules that read the options of the environment, or are fitted to its simulation."""

CLASSICAL_NAMES = (*CLASSICAL, *FITTED)


def policy_family(name: str, decider: "PolicyDecider") -> DeciderFamily:
    """Return the family of a trained policy; its threshold is the log-odds of declaring."""
    return DeciderFamily(name, "log-odds", LOG_ODDS, 0.0, decider.with_threshold, decider.hypotheses)


def anchor_family(name: str, net: "AnchorNetworks", world: WorldOptions) -> DeciderFamily:
    """Return the family of a trained anchor agent; its threshold is the expected loss of a declaration."""
    from agents.learned.anchor_decider import AnchorDecider

    return DeciderFamily(name, "alpha", FEW_ALPHAS, 0.02, lambda alpha: AnchorDecider(net, world, alpha))


def _policy_folder(name: str) -> Path:
    """Return the folder of the shipped agent or of a run; for an empty name, one that does not exist."""
    return SHIPPED_FOLDER if name == SHIPPED else Path(name or os.devnull)


def decider_family(name: str, world: WorldOptions) -> DeciderFamily:
    """Return the family of a classical rule, of the shipped agent or of a run folder, for an environment.

    Raises:
        ArgumentError: an unknown name or an unreadable run folder.
    """
    if name in CLASSICAL:
        return CLASSICAL[name]
    if name in FITTED:
        return FITTED[name](world)
    folder = _policy_folder(name)
    if folder.is_dir():
        return learned_family(folder, world)
    known = ", ".join(map(repr, (*CLASSICAL_NAMES, SHIPPED)))
    raise reject("decider", name, f"{known} or the path of a run folder, each with an optional ':threshold'")


def learned_family(folder: Path, world: WorldOptions) -> DeciderFamily:
    """Return the family of the policy in a run folder, for any training algorithm.

    Raises:
        ArgumentError: the folder cannot be read, or its agent is for unknown switch moments.
    """
    from agents.learned.policy_file import card_layout, load_policy

    weights, card = load_policy(folder)
    if card_layout(card) is not Layout:
        raise reject("decider", str(folder), "a policy for known switch moments")
    if card["recipe"]["entry"]["algo"] == "anchor":
        from agents.learned.anchor_decider import load_anchor

        return anchor_family(folder.name, load_anchor(folder, weights, card), world)
    from agents.learned.policy import PolicyDecider, load_actor

    return policy_family(folder.name, PolicyDecider(load_actor(folder, weights, card)))


def load_decider(name: str, options: WorldOptions) -> Decider:
    """Return the decider for "ate", "ate:1e-6", "fixed:25", "runs/ppo" or "runs/ppo:-2".

    Args:
        name: classical rule or run folder, with an optional threshold after a colon.
        options: of the environment to decide in.

    Raises:
        ArgumentError: unknown name, invalid threshold, or a policy trained for another number of hypotheses.
    """
    base, threshold = split_threshold(name)
    family = decider_family(base, options)
    whole = family.symbol == "ticks"
    if threshold is not None and family is ML_AT_END:
        raise reject("decider", name, "'ml' without a threshold: it declares at the end of the segment")
    if threshold is not None and (not np.isfinite(threshold) or (whole and threshold % 1)):
        allowed = "a whole number" if whole else "a finite number"
        raise reject("decider", name, f"{allowed} after the colon")
    if options.actions != "all":
        raise reject("actions", options.actions, "'all': deciders declare hypotheses")
    for key, value in family.options.items():
        if str(getattr(options, key)) != value:
            raise reject(key, getattr(options, key), f"{value!r} for the decider {name!r}")
    check_family(family, name, options)
    return family.make(family.default if threshold is None else threshold)


def split_threshold(name: str) -> tuple[str, float | None]:
    """Return the name of a decider and the threshold after its colon, None if there is none.

    Raises:
        ArgumentError: what follows the colon is not a number.
    """
    base, colon, text = name.rpartition(":")
    if not colon or Path(name).is_dir():
        return name, None
    try:
        return base, float(text)
    except ValueError:
        raise reject("decider", name, "a number after the colon") from None


def world_changes(name: str, world: WorldOptions) -> dict[str, Any]:
    """Return the options of an environment that a classical rule changes, see `DeciderFamily.options`."""
    base = name.partition(":")[0]
    return dict(FITTED[base](world).options) if base in FITTED else {}


def check_family(family: DeciderFamily, name: str, options: ModelOptions) -> None:
    """Check that a decider applies to the number of hypotheses of an environment.

    Raises:
        ArgumentError: the policy was trained for another number.
    """
    if family.hypotheses not in (None, options.hypotheses):
        raise reject(
            "decider",
            name,
            f"a policy for {options.hypotheses} hypotheses; this one is for {family.hypotheses}",
        )
