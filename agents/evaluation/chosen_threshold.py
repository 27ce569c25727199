"""Deciders that choose their threshold: 'msprt:auto' for the reward, 'msprt:2%' for an error rate.

For unknown switches the rate is that of wrong changes, 'beam:3/1000' for three in 1,000 ticks.

The threshold is selected on simulated episodes of what the decider is told: the options of the
environment without the law of the noise, which is measured on other episodes than those that are
decided, see `measured_noise`.
"""

import functools
import warnings

import numpy as np

from agents.evaluation.measured_noise import measured_noise
from agents.evaluation.task import Task, sweep
from agents.evaluation.tasks import ENVIRONMENTS, task_of
from baselines.rules import seeds
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Decider
from baselines.rules.rollout import rollout, statement_env
from baselines.rules.threshold import ThresholdDecider
from baselines.scoring.scores import Scores
from hybrid_env.checks import FloatArray, reject
from hybrid_env.options import ModelOptions
from hybrid_env.quickest_options import QuickestOptions

AUTO = "auto"
# That are simulated at every threshold.
EPISODES = {ANNOUNCED: 400, UNKNOWN: 60}
RATES = {ANNOUNCED: "%", UNKNOWN: "/1000"}
"""Units of the rates that can be asked for: wrong declarations, and wrong changes in ticks."""


def is_chosen(text: str) -> bool:
    """Return whether a threshold is to be chosen: "auto", or a rate such as "2%" or "3/1000"."""
    return text == AUTO or text.endswith(tuple(RATES.values()))


def choosing_decider(decider: Decider, options: ModelOptions, ending: str) -> Decider:
    """Return a decider without a threshold, see `is_chosen`; it is told all options but the
    law of the noise.
    """
    task = task_of(ENVIRONMENTS[options.switches], vars(options))
    name, unit = f"{decider.title}:{ending}", RATES[task.switches]
    if len(decider.thresholds) == 1:
        raise reject("decider", name, "a decider with a threshold")
    rate = None
    if ending != AUTO:
        try:
            rate = float(ending.removesuffix(unit))
        except ValueError:
            rate = np.nan
        if not 0.0 < rate < 50.0:
            raise reject(
                "decider",
                name,
                f"a rate above 0 and below 50 such as '{decider.title}:2{unit}'",
            )

    @functools.cache
    def chosen() -> float:
        task_told = task.changed({"noise": measured_noise(options)})
        highest = reachable(decider, task_told.options)
        within = decider.changed(
            thresholds=tuple(each for each in decider.thresholds if each <= highest)
        )
        scores = sweep(task_told, within, EPISODES[task_told.switches], seeds.CHOOSING)
        return (
            float(within.thresholds[task_told.best(scores)])
            if rate is None
            else _holding(task_told, within, scores, rate)
        )

    attributes = {"title": name, "symbol": "", "thresholds": (0.0,), "default": 0.0}
    return decider.changed(
        **attributes,
        threshold=0.0,
        create_at=lambda _: decider.at(chosen()).changed(**attributes),
    )


def reachable(decider: Decider, options: ModelOptions, episodes: int = 20) -> float:
    """Return the largest threshold on probabilities that every mode reaches in half of the
    simulated episodes in which it is true, so that no mode is never stated; infinity for other
    thresholds, and for announced switches.
    """
    if not isinstance(options, QuickestOptions) or decider.symbol != ThresholdDecider.symbol:
        return np.inf
    env = statement_env(options, episodes)
    largest = np.zeros((episodes, options.hypotheses))
    tracks = np.arange(episodes)
    for now in rollout(env, decider, seeds.CHOOSING):
        if now.step == options.ticks:
            break
        true = env.world.field("true_mode").copy()
        evidence = decider.evidence(now.seen, now.state, now.starts)
        largest[tracks, true] = np.maximum(largest[tracks, true], evidence[tracks, true])
    reached = np.where(largest > 0.0, largest, np.nan)
    seen_modes = ~np.isnan(reached).all(0)
    return float(np.nanmedian(reached[:, seen_modes], axis=0).min())


def _rates(task: Task, scores: Scores) -> FloatArray:
    """Return the rate at every threshold, in the unit of `RATES`."""
    if task.switches == UNKNOWN:
        return scores.curve(task.statistic("wrong_changes"))
    accuracy = "accuracy" if task.options.correctness == "exact" else "type_accuracy"
    return 100.0 * (1.0 - scores.curve(task.statistic(accuracy)))


def _holding(task: Task, decider: Decider, scores: Scores, rate: float) -> float:
    """Return the threshold that holds a rate with the least delay; without one, warn and return
    the best one.
    """
    thresholds, rates = np.array(decider.thresholds), _rates(task, scores)
    delays = scores.curve(task.statistic("ticks" if task.switches == ANNOUNCED else "full_delay"))
    held = np.flatnonzero(rates <= rate)
    if not held.size:
        best = int(rates.argmin())
        unit = RATES[task.switches]
        at_best = f"{rates[best]:.3g}{unit} at best, with {decider.symbol} {thresholds[best]:g}"
        warnings.warn(
            f"{decider.title} cannot hold a rate of {rate:g}{unit}: {at_best}",
            stacklevel=2,
        )
        return float(thresholds[best])
    first = int(held[delays[held].argmin()])
    if first == 0 or rates[first - 1] <= rate or thresholds.min() <= 0.0:
        return float(thresholds[first])

    # The logarithm of the rate is nearly linear.
    def interpolated(at: FloatArray, measured: FloatArray) -> float:
        slope, level = np.polyfit(np.log(at), np.log(np.maximum(measured, 0.1 * rate)), 1)
        return (
            float(np.clip(np.exp((np.log(rate) - level) / slope), at.min(), at.max()))
            if slope
            else float(at[1])
        )

    about = interpolated(thresholds[first - 1 : first + 1], rates[first - 1 : first + 1])
    near = np.clip(
        about * np.array([1.0 / 1.6, 1.0, 1.6]),
        thresholds.min(),
        thresholds.max(),
    )
    episodes = EPISODES[task.switches]
    again = sweep(
        task,
        decider,
        3 * episodes,
        seeds.CHOOSING + episodes,
        thresholds=tuple(near.tolist()),
    )
    return interpolated(near, _rates(task, again))
