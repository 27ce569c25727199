"""Deciders that choose their threshold: 'shipped:auto' for the reward, 'shipped:2%' for an error rate.

The threshold is selected on simulated episodes of what the decider is told: the options of the environment
without the law of the noise, of which nobody tells. Nothing of the episodes that are decided is used.
"""

import dataclasses
import functools
import warnings

import numpy as np

from agents.evaluation.task import sweep
from agents.evaluation.tasks import task_of
from baselines.rules import seeds
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Decider, DeciderFamily
from hybrid_env.checks import reject
from hybrid_env.options import ModelOptions

AUTO = "auto"
ENVIRONMENTS = {ANNOUNCED: "hybrid_env:HybridTrack-v0", UNKNOWN: "hybrid_env:HybridTrackQuickest-v0"}
EPISODES = {ANNOUNCED: 400, UNKNOWN: 60}
"""Simulated episodes."""


def stopping_rule(name: str) -> tuple[str, float | None] | None:
    """Return the decider of "shipped:auto" or "shipped:2%" and its error rate, None for the reward.

    Returns None for other names.

    Raises:
        ArgumentError: an error rate that is not allowed.
    """
    base, colon, text = name.rpartition(":")
    if not colon or not (text == AUTO or text.endswith("%")):
        return None
    if text == AUTO:
        return base, None
    try:
        rate = float(text[:-1]) / 100.0
    except ValueError:
        rate = np.nan
    if not 0.0 < rate < 0.5:
        raise reject("decider", name, "an error rate above 0 % and below 50 %, such as 'ate:2%'")
    return base, rate


def stopping_family(family: DeciderFamily, options: ModelOptions, error: float | None) -> DeciderFamily:
    """Return a decider without a threshold.

    Args:
        family: the decider at any threshold.
        options: of the environment; the decider is told all but the law of the noise.
        error: error rate that is asked for; None earns the largest reward.

    Raises:
        ArgumentError: an error rate for a decider or a task without one.
    """
    told = task_of(ENVIRONMENTS[options.switches], {**vars(options), "noise": "gaussian"})
    ending = AUTO if error is None else f"{100.0 * error:g}%"
    if len(family.thresholds) == 1:
        raise reject("decider", f"{family.name}:{ending}", "a decider with a threshold")
    if error is not None and told.switches != ANNOUNCED:
        raise reject("decider", f"{family.name}:{ending}", "an error rate where switches are announced")

    @functools.cache
    def chosen() -> float:
        scores = sweep(told, family, EPISODES[told.switches], seeds.STOPPING)
        if error is None:
            return float(family.thresholds[told.best(scores)])
        exact = told.options.correctness == "exact"
        errors = 1.0 - scores.curve(told.statistic("accuracy" if exact else "type_accuracy"))
        held = np.flatnonzero(errors <= error)
        if not held.size:
            best = int(errors.argmin())
            warnings.warn(
                f"{family.name} cannot hold an error rate of {error:.1%}: {errors[best]:.1%} at best, with "
                f"{family.symbol} {family.thresholds[best]:g}",
                stacklevel=2,
            )
            return float(family.thresholds[best])
        first = int(held[scores.curve(told.statistic("ticks"))[held].argmin()])
        if first == 0 or errors[first - 1] <= error or min(family.thresholds) <= 0.0:
            return float(family.thresholds[first])
        ends = np.array([first, first - 1])  # between them the logarithm of the error is nearly linear
        logs = np.log(np.maximum(errors[ends], 0.1 * error))
        return float(np.exp(np.interp(np.log(error), logs, np.log(np.array(family.thresholds)[ends]))))

    def make(_: float) -> Decider:
        return family.make(chosen())

    return dataclasses.replace(
        family, name=f"{family.name}:{ending}", symbol="", thresholds=(0.0,), default=0.0, make=make
    )
