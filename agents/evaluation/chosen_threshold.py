"""Deciders that choose their threshold: 'msprt:auto' for the reward, 'msprt:2%' for an error rate.

For unknown switches the rate is that of wrong changes, 'beam:3/1000' for three in 1,000 ticks.

The threshold is selected on simulated episodes of what the decider is told: the options of the
environment without the law of the noise, which is measured on other episodes than those that are
decided, see `measured_noise`.
"""

import dataclasses
import functools
import warnings

import numpy as np

from agents.evaluation.measured_noise import measured_noise
from agents.evaluation.task import Task, sweep
from agents.evaluation.tasks import ENVIRONMENTS, task_of
from baselines.rules import seeds
from baselines.rules.decider import ANNOUNCED, UNKNOWN, DeciderFamily
from baselines.rules.threshold import ThresholdDecider
from baselines.scoring.scores import Scores
from hybrid_env.checks import FloatArray, reject
from hybrid_env.options import ModelOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv

AUTO = "auto"
# That are simulated at every threshold.
EPISODES = {ANNOUNCED: 400, UNKNOWN: 60}
# Factor between three thresholds at which more episodes are simulated for a rate.
NEARBY = 1.6
# Episodes in which it is looked which thresholds are reached.
REACHING = 20
# As many of them, in units of EPISODES.
MORE = 3
RATES = {ANNOUNCED: "%", UNKNOWN: "/1000"}
"""Units of the rates that can be asked for: wrong declarations, and wrong changes in ticks."""
LARGEST_RATE = 50.0


def chosen_rule(name: str) -> tuple[str, str] | None:
    """Return the decider and the ending of "msprt:auto", "msprt:2%" or "beam:3/1000"; None for
    other names.
    """
    base, colon, ending = name.rpartition(":")
    return (
        (base, ending)
        if colon and (ending == AUTO or ending.endswith(tuple(RATES.values())))
        else None
    )


def chosen_family(family: DeciderFamily, options: ModelOptions, ending: str) -> DeciderFamily:
    """Return a decider without a threshold, see `chosen_rule`; it is told all options but the
    law of the noise.
    """
    task = task_of(ENVIRONMENTS[options.switches], vars(options))
    name, unit = f"{family.name}:{ending}", RATES[task.switches]
    if len(family.thresholds) == 1:
        raise reject("decider", name, "a decider with a threshold")
    rate = None
    if ending != AUTO:
        try:
            rate = float(ending.removesuffix(unit))
        except ValueError:
            rate = np.nan
        if not 0.0 < rate < LARGEST_RATE:
            raise reject(
                "decider",
                name,
                f"a rate above 0 and below {LARGEST_RATE:g} such as '{family.name}:2{unit}'",
            )

    @functools.cache
    def chosen() -> float:
        told = task.changed({"noise": measured_noise(options)})
        highest = reachable(family, told.options)
        within = dataclasses.replace(
            family,
            thresholds=tuple(one for one in family.thresholds if one <= highest),
        )
        scores = sweep(told, within, EPISODES[told.switches], seeds.CHOOSING)
        return (
            float(within.thresholds[told.best(scores)])
            if rate is None
            else _holding(told, within, scores, rate)
        )

    return dataclasses.replace(
        family,
        name=name,
        symbol="",
        thresholds=(0.0,),
        default=0.0,
        make=lambda _: family.make(chosen()),
    )


def reachable(family: DeciderFamily, options: ModelOptions) -> float:
    """Return the largest threshold on probabilities that every mode reaches in half of the
    simulated episodes in which it is true, so that no mode is never stated; infinity for other
    thresholds, and for announced switches.
    """
    if not isinstance(options, QuickestOptions) or family.symbol != ThresholdDecider.symbol:
        return np.inf
    decider = family.make(family.default)
    env = HybridTrackQuickestVectorEnv(
        REACHING,
        autoreset_mode="Disabled",
        tick_info=False,
        **vars(options),
    )
    env.reset(seed=seeds.CHOOSING)
    largest = np.zeros((REACHING, options.hypotheses))
    state = None
    first = np.ones(REACHING, np.bool_)
    tracks = np.arange(REACHING)
    for _ in range(options.ticks):
        seen = decider.observe(env.world)
        true = env.world.field("true_mode").copy()
        evidence = decider.evidence(seen, state, first)
        largest[tracks, true] = np.maximum(largest[tracks, true], evidence[tracks, true])
        actions, state = decider.predict(seen, state, first)
        env.step(actions)
        first = np.zeros(REACHING, np.bool_)
    reached = np.where(largest > 0.0, largest, np.nan)
    seen_modes = ~np.isnan(reached).all(0)
    return float(np.nanmedian(reached[:, seen_modes], axis=0).min())


def _rates(told: Task, scores: Scores) -> FloatArray:
    """Return the rate at every threshold, in the unit of `RATES`."""
    if told.switches == UNKNOWN:
        return scores.curve(told.statistic("wrong_changes"))
    accuracy = "accuracy" if told.options.correctness == "exact" else "type_accuracy"
    return 100.0 * (1.0 - scores.curve(told.statistic(accuracy)))


def _holding(told: Task, family: DeciderFamily, scores: Scores, rate: float) -> float:
    """Return the threshold that holds a rate with the least delay; without one, warn and return
    the best one.
    """
    thresholds, rates = np.array(family.thresholds), _rates(told, scores)
    delays = scores.curve(told.statistic("ticks" if told.switches == ANNOUNCED else "full_delay"))
    held = np.flatnonzero(rates <= rate)
    if not held.size:
        best = int(rates.argmin())
        unit = RATES[told.switches]
        at_best = f"{rates[best]:.3g}{unit} at best, with {family.symbol} {thresholds[best]:g}"
        warnings.warn(
            f"{family.name} cannot hold a rate of {rate:g}{unit}: {at_best}",
            stacklevel=2,
        )
        return float(thresholds[best])
    first = int(held[delays[held].argmin()])
    if first == 0 or rates[first - 1] <= rate or thresholds.min() <= 0.0:
        return float(thresholds[first])

    # The logarithm of the rate is nearly linear.
    def interpolated(at: FloatArray, found: FloatArray) -> float:
        slope, level = np.polyfit(np.log(at), np.log(np.maximum(found, 0.1 * rate)), 1)
        return (
            float(np.clip(np.exp((np.log(rate) - level) / slope), at.min(), at.max()))
            if slope
            else float(at[1])
        )

    about = interpolated(thresholds[first - 1 : first + 1], rates[first - 1 : first + 1])
    near = np.clip(
        about * np.array([1.0 / NEARBY, 1.0, NEARBY]),
        thresholds.min(),
        thresholds.max(),
    )
    episodes = EPISODES[told.switches]
    again = sweep(
        told,
        family,
        MORE * episodes,
        seeds.CHOOSING + episodes,
        thresholds=tuple(near.tolist()),
    )
    return interpolated(near, _rates(told, again))
