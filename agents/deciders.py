"""Deciders by name: the classical rules with the thresholds that they are swept over, and run folders."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from baselines import FixedTimeDecider, SPRTDecider
from baselines.decider import Decider
from hybrid_env.checks import reject
from hybrid_env.options import WorldOptions

if TYPE_CHECKING:
    from agents.policy import PolicyDecider


@dataclass(frozen=True)
class DeciderFamily:
    """A decider with one threshold that trades time for accuracy.

    Attributes:
        name: as tables show it.
        symbol: of the threshold.
        thresholds: swept over, in the order of growing decision time.
        default: threshold of the decider when nothing is said.
        make: decider at a threshold.
        hypotheses: M of the only bank that it can read; None reads any.
    """

    name: str
    symbol: str
    thresholds: tuple[float, ...]
    default: float
    make: Callable[[float], Decider]
    hypotheses: int | None = None


ATE = DeciderFamily(
    "ATE (SPRT)",
    "alpha",
    (0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10),
    1e-3,
    SPRTDecider,
)
FIXED_TIME = DeciderFamily(
    "fixed time",
    "ticks",
    (5, 10, 15, 18, 20, 22, 24, 25, 26, 28, 30, 32, 34, 36, 40, 45, 50, 60, 80, 100),
    25,
    lambda ticks: FixedTimeDecider(int(ticks)),
)
CLASSICAL = {"ate": ATE, "fixed": FIXED_TIME}
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


def policy_family(name: str, decider: "PolicyDecider") -> DeciderFamily:
    """The family of a trained policy, its threshold the log-odds of declaring."""
    return DeciderFamily(name, "log-odds", LOG_ODDS, 0.0, decider.with_threshold, decider.hypotheses)


def decider_family(name: str) -> DeciderFamily:
    """The family of a classical name or of a run folder."""
    if name in CLASSICAL:
        return CLASSICAL[name]
    folder = Path(name)
    if name and folder.is_dir():
        from agents.policy import PolicyDecider, load_policy

        return policy_family(folder.name, PolicyDecider(load_policy(folder)[0]))
    known = ", ".join(map(repr, CLASSICAL))
    raise reject("decider", name, f"{known} or the path of a run folder, each with an optional ':threshold'")


def load_decider(name: str, options: WorldOptions) -> Decider:
    """The decider of "ate", "ate:1e-6", "fixed:25", "runs/ppo" or "runs/ppo:-2".

    Args:
        name: classical name or run folder, with an optional threshold after a colon.
        options: of the world it is to decide in.

    Raises:
        ValueError: unknown name, bad threshold, or a policy trained for another bank.
    """
    base, colon, text = name.rpartition(":")
    try:
        threshold = float(text) if colon and not Path(name).is_dir() else None
    except ValueError:
        raise reject("decider", name, "a number after the colon") from None
    family = decider_family(base if threshold is not None else name)
    if threshold is not None and (not np.isfinite(threshold) or (family is FIXED_TIME and threshold % 1)):
        allowed = "a whole number" if family is FIXED_TIME else "a finite number"
        raise reject("decider", name, f"{allowed} after the colon")
    if options.actions != "all":
        raise reject("actions", options.actions, "'all' for a decider, which declares hypotheses")
    check_family(family, name, options)
    return family.make(family.default if threshold is None else threshold)


def check_family(family: DeciderFamily, name: str, options: WorldOptions) -> None:
    """Refuse a policy that was trained for another number of hypotheses."""
    if family.hypotheses not in (None, options.hypotheses):
        raise reject(
            "decider", name, f"a policy for {options.hypotheses} hypotheses; it has {family.hypotheses}"
        )
