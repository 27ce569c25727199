"""The threshold of a decider: that which earns most, or holds an error rate, on episodes that no
report uses.

'msprt:auto' chooses it for the reward and 'msprt:2%' for an error rate; for unknown switches the
rate is that of wrong changes, 'beam:3/1000' for three in 1,000 ticks. Then it is selected on other
episodes of the environment than those that are decided.
"""

import functools
import warnings

import numpy as np

from agents.evaluation.task import Task, sweep, task_with
from baselines.rules import seeds
from baselines.rules.decider import Decider
from baselines.rules.msprt import ALPHAS
from baselines.rules.rollout import rollout, statement_env
from baselines.rules.threshold import ThresholdDecider
from baselines.scoring.scores import Scores
from hybrid_env.checks import FloatArray, reject
from hybrid_env.options import ModelOptions
from hybrid_env.quickest_options import QuickestOptions


def select_threshold(task: Task, decider: Decider, episodes: int) -> float:
    """Return the threshold with the best mean reward, among a few of a decider.

    Args:
        task, decider: see `task_of` and `find_decider`.
        episodes: number of episodes to select on, at most 1,000; they have other seeds than those
            of any report.
    """
    few = (0.6, 0.4, 0.25, 0.15, 0.1, 0.08, 0.05, 0.03, 0.02, 0.01, 3e-3, 3e-4, 1e-5)
    thresholds = few if decider.thresholds == ALPHAS else decider.thresholds
    # At most 13, spread over those of the decider.
    thresholds = thresholds[:: -(-len(thresholds) // 13)]
    count = min(episodes, seeds.SELECTION_EPISODES)
    scores = sweep(task, decider, count, seeds.SELECTION, thresholds=thresholds)
    return thresholds[task.best(scores)]


def choosing_decider(decider: Decider, options: ModelOptions, ending: str) -> Decider:
    """Return a decider without a threshold, which chooses it when it is made: for the reward if
    the ending is "auto", else for a rate such as "2%" or "3/1000".
    """
    task = task_with(options)
    name = f"{decider.title}:{ending}"
    if len(decider.thresholds) == 1:
        raise reject("decider", name, "a decider with a threshold")
    rate = None if ending == "auto" else _rate(ending, decider.title, task.rate_unit)

    @functools.cache
    def chosen() -> float:
        highest = reachable(decider, options)
        within = decider.changed(
            thresholds=tuple(each for each in decider.thresholds if each <= highest)
        )
        scores = sweep(task, within, task.choosing_episodes, seeds.CHOOSING)
        if rate is None:
            return float(within.thresholds[task.best(scores)])
        return _holding(task, within, scores, rate)

    attributes = {"title": name, "symbol": "", "thresholds": (0.0,), "default": 0.0}
    return decider.changed(
        **attributes, threshold=0.0, at=lambda _: decider.at(chosen()).changed(**attributes)
    )


def _rate(ending: str, title: str, unit: str) -> float:
    try:
        rate = float(ending.removesuffix(unit))
    except ValueError:
        rate = np.nan
    if not 0.0 < rate < 50.0:
        allowed = f"a rate above 0 and below 50 such as '{title}:2{unit}'"
        raise reject("decider", f"{title}:{ending}", allowed)
    return rate


def reachable(decider: Decider, options: ModelOptions) -> float:
    """Return the largest threshold on probabilities that every mode reaches in half of the
    simulated episodes in which it is true, so that no mode is never stated; infinity for other
    thresholds, and for announced switches.
    """
    if not isinstance(options, QuickestOptions) or decider.symbol != ThresholdDecider.symbol:
        return np.inf
    episodes = 20
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


def _holding(task: Task, decider: Decider, scores: Scores, rate: float) -> float:
    """Return the threshold that holds a rate with the least delay; without one, warn and return
    the best one.
    """
    thresholds, rates = np.array(decider.thresholds), task.error_rates(scores)
    held = np.flatnonzero(rates <= rate)
    if not held.size:
        best = int(rates.argmin())
        unit = task.rate_unit
        at_best = f"{rates[best]:.3g}{unit} at best, with {decider.symbol} {thresholds[best]:g}"
        warnings.warn(
            f"{decider.title} cannot hold a rate of {rate:g}{unit}: {at_best}", stacklevel=2
        )
        return float(thresholds[best])
    first = int(held[scores.curve(task.statistic(task.delay))[held].argmin()])
    if first == 0 or rates[first - 1] <= rate:
        return float(thresholds[first])
    # The logarithm of the rate is nearly linear in log-odds, and in the logarithms of others.
    in_logs = thresholds.min() > 0.0
    places = np.log(thresholds) if in_logs else thresholds

    def interpolated(at: FloatArray, measured: FloatArray) -> float:
        slope, level = np.polyfit(at, np.log(np.maximum(measured, 0.1 * rate)), 1)
        place = (np.log(rate) - level) / slope if slope else at[1]
        return float(np.clip(place, at.min(), at.max()))

    about = interpolated(places[first - 1 : first + 1], rates[first - 1 : first + 1])
    step = np.log(1.6) if in_logs else 0.25 * (places[first] - places[first - 1])
    near = np.clip(about + step * np.array([-1.0, 0.0, 1.0]), places.min(), places.max())
    tried = tuple((np.exp(near) if in_logs else near).tolist())
    episodes = task.choosing_episodes
    again = sweep(task, decider, 3 * episodes, seeds.CHOOSING + episodes, thresholds=tried)
    place = interpolated(near, task.error_rates(again))
    return float(np.exp(place)) if in_logs else place
