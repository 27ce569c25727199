"""Rules with more and more information, on every filter bank and noise level."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from joblib import delayed

from agents import Task, bound_scores, find_decider, sweep, task_of
from baselines import Scores, rollout
from hybrid_env import HybridTrackVectorEnv, Layout

# Three hypotheses and 21 of the published bank, and three with unknown switches.
THREE, BANK, QUICKEST = (
    f"HybridTrack{part}-v0" for part in ("Published", "PublishedBank", "Quickest")
)
# Thresholds are selected on episodes from this seed on; reported ones begin at 0.
SELECTION = 1_000_000_000
BANKS = ("published", "anchor_aware", "oracle")
# Decider and changed options of each step for announced switches, with more and more information.
STEPS: dict[str, tuple[str, dict[str, Any]]] = {
    "ATE on the published bank": ("ate", {}),
    "MSPRT: every hypothesis is compared with every other": ("msprt", {}),
    "the filters start from the covariance of the estimate": ("msprt-kept", {}),
    "the distribution of the anchor error is computed": ("propagated", {}),
    "MSPRT on the anchor-aware bank, which reads the full covariance": (
        "msprt-aware",
        {"bank": "anchor_aware"},
    ),
    "all filters run on, and the next anchor is merged": (
        "msprt-aware",
        {"bank": "anchor_aware", "follow": "bank"},
    ),
    "the anchor is exact (oracle, not available in practice)": ("msprt", {"bank": "oracle"}),
}
# Default ids, and the ticks between their decisions, at which the bound is simulated.
BOUNDED = "HybridTrack-v0", "HybridTrackBank-v0"
GRIDS = (1, 8)
CALIBRATION_BANKS: dict[str, dict[str, Any]] = {
    "anchor-aware": {"bank": "anchor_aware"},
    "published, P kept": {"bank": "published", "reset_covariance": False},
    "published": {"bank": "published"},
    "oracle": {"bank": "oracle"},
}
# A row of a table, as in JSON: place, noise level R [m^2], step or rule, threshold, and
# `Estimate`s.
Row = dict[str, Any]


def calls(unknown: bool, episodes: int, quick: bool) -> dict[str, list[Any]]:
    """Return the `joblib.delayed` calls of the study by its parts; every call returns a list of
    rows.

    A third as many other episodes, at least 50, serve to select thresholds, those with the largest
    mean reward.

    Args:
        unknown: whether switch moments are unknown; else both environments with known ones are
            evaluated.
        episodes: number of episodes.
        quick: whether only one noise level is evaluated, with three hypotheses or one law.
    """
    # R [m^2]
    noises = (0.1,) if quick else (0.01, 0.1, 1.0)
    if unknown:
        laws = ("uniform 50-100",) if quick else ("25 + geometric 50", "uniform 50-100")
        return {
            "steps": [delayed(unknown_steps)(*place, episodes) for place in product(laws, noises)]
        }
    rules = {THREE: ("ate", "msprt"), BANK: ("ate", "msprt-type", "msprt")}
    places = list(product([THREE] if quick else rules, noises))
    return {
        "bound": [
            delayed(bound_rows)(*place, episodes)
            for place in product(BOUNDED[: 1 if quick else None], noises, GRIDS)
        ],
        "steps": [delayed(announced_steps)(*place, episodes) for place in places],
        "rules": [
            delayed(rule_on_bank)(*place, bank, rule, episodes)
            for place in places
            for bank, rule in product(BANKS, rules[place[0]])
        ],
        "calibration": [
            delayed(bank_calibration)(bank, noise, 1000 if quick else 10_000)
            for bank, noise in product(CALIBRATION_BANKS, noises)
        ],
    }


def best_threshold(task: Task, decider: Any, episodes: int) -> int:
    """Return the index of the threshold with the best reward on a third as many other episodes."""
    return task.best(sweep(task, decider, max(episodes // 3, 10), SELECTION))


def step_rows(
    task: Task,
    place: str,
    noise: float,
    steps: dict[str, Scores],
    compared: Sequence[Scores | None] = (),
) -> list[Row]:
    """Return a row of each step, from scores at one threshold, with the gain of reward over the
    scores that the step is compared with, by default those of the step before.
    """
    others = compared or [None, *steps.values()]
    reward = task.statistic("reward")
    return [
        {
            "place": place,
            "noise": noise,
            "step": step,
            "threshold": scores.thresholds[0],
            "reward": scores.estimate(reward),
            "gain": before and scores.difference(before, reward),
        }
        for before, (step, scores) in zip(others, steps.items(), strict=False)
    ]


def bound_rows(env_id: str, noise: float, every: int, episodes: int) -> list[Row]:
    """Return the rewards of what needs no learning, of the best rule and of a learned stop at a
    noise level, with decisions every so many ticks, each less the bound, and the bound.
    """
    task = task_of(env_id, {"measurement_variance": noise, "decide_every": every})
    bound = bound_scores(task, episodes, 0)
    steps = {}
    for name in ("at-once", task.deciders[-1], "shipped"):
        decider = find_decider(name, task.options)
        threshold = decider.thresholds[best_threshold(task, decider, episodes)]
        steps[decider.title] = sweep(task, decider, episodes, 0, thresholds=(threshold,))
    place = f"{env_id}, a decision " + ("at every tick" if every == 1 else f"every {every} ticks")
    compared = [bound] * len(steps) + [None]
    return step_rows(task, place, noise, {**steps, "bound": bound}, compared)


def announced_steps(env_id: str, noise: float, episodes: int) -> list[Row]:
    """Evaluate every step for announced switches at a noise level."""
    steps = {}
    for step, (name, changes) in STEPS.items():
        task = task_of(env_id, {"measurement_variance": noise, **changes})
        by_type = name == "msprt" and task.options.correctness == "type"
        decider = find_decider("msprt-type" if by_type else name, task.options)
        threshold = decider.thresholds[best_threshold(task, decider, episodes)]
        steps[step] = sweep(task, decider, episodes, 0, thresholds=(threshold,))
    return step_rows(task, env_id, noise, steps)


def rule_on_bank(env_id: str, noise: float, bank: str, rule: str, episodes: int) -> list[Row]:
    """Evaluate a rule on a bank at a noise level, at all thresholds."""
    task = task_of(env_id, {"measurement_variance": noise, "bank": bank})
    # ATE itself brings the published bank.
    name = "sprt" if rule == "ate" and bank != "published" else rule
    decider = find_decider(name, task.options)
    best = best_threshold(task, decider, episodes)
    curve = sweep(task, decider, episodes, 0)
    times = {
        metric.name.replace("ticks_at", "time"): curve.estimate(metric.statistic)
        for metric in task.levels(curve, decider.thresholds[best])
        if metric.name.startswith("ticks_at")
    }
    row: Row = {"env_id": env_id, "noise": noise, "bank": bank, "rule": decider.title, **times}
    reward = curve.at(best).estimate(task.statistic("reward"))
    return [row | {"reward": reward, "threshold": decider.thresholds[best]}]


def bank_calibration(
    bank: str, noise: float, episodes: int, ticks: tuple[int, ...] = (2, 5, 10, 20, 40)
) -> list[Row]:
    """Return the calibration of the posterior of a bank after numbers of ticks without a decision,
    at a noise level on HybridTrackPublished-v0.

    Of a row, "right" is the accuracy of the most probable hypothesis, "stated" its mean posterior,
    and "worst" the largest calibration error: posterior minus accuracy in a bin. Segments are
    decided at their end, so that most anchors are accurate.
    """
    options = {"measurement_variance": noise, "undecided": "likeliest", **CALIBRATION_BANKS[bank]}
    env = HybridTrackVectorEnv(episodes, tick_info=False, **options)
    layout, segments = Layout(env.options.hypotheses), env.options.segments
    # By segment, so that sums do not depend on the order in which tracks reach a tick.
    stated = np.full((len(ticks), episodes, segments), np.nan)
    right = np.zeros(stated.shape, np.bool_)
    running = np.ones(episodes, np.bool_)
    for now in rollout(env, lambda rows: np.zeros(len(rows), np.int64), 0):
        running &= ~(now.terminated & (now.step > 0))
        if not running.any():
            break
        error = np.exp(layout.read(now.observation, "log_error_probability"))
        best = layout.read(now.observation, "log_ratio").argmax(-1)
        correct = best == env.world.field("true_mode")
        for k, tick in enumerate(ticks):
            reached = np.flatnonzero(running & (env.world.field("tick") == tick))
            places = k, reached, env.world.field("segment")[reached]
            stated[places], right[places] = 1.0 - error[reached], correct[reached]
    return [
        {"bank": bank, "noise": noise, "ticks": tick, **_calibration(of_tick[known], named[known])}
        for tick, of_tick, named in zip(ticks, stated, right, strict=True)
        if (known := ~np.isnan(of_tick)).any()
    ]


def _calibration(stated: Any, right: Any) -> Row:
    """Return values of stated posteriors (n,) and of whether they were right, (n,)."""
    edges = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
    bins = pd.DataFrame({"stated": stated, "right": right}).groupby(np.digitize(stated, edges))
    # In smaller bins the accuracy has a standard error of up to 1.6 percentage points.
    means = bins.mean()[bins.size() >= 1000]
    gaps = (means["stated"] - means["right"]).to_numpy()
    worst = gaps[np.abs(gaps).argmax()] if gaps.size else None
    return {"right": right.mean(), "stated": stated.mean(), "worst": worst}


def unknown_steps(law: str, noise: float, tracks: int) -> list[Row]:
    """Evaluate every step for unknown switches for a law and a noise level, on the same tracks."""
    task = task_of(QUICKEST, {"durations": law, "measurement_variance": noise})
    selection = _curves(task, max(tracks // 3, 50), SELECTION)
    curves = _curves(task, tracks, 0)
    steps = {step: curve.at(task.best(selection[step])) for step, curve in curves.items()}
    return step_rows(task, f"durations {law}", noise, steps)


def _curves(task: Task, tracks: int, seed: int) -> dict[str, Scores]:
    """Return the scores of all steps; the first threshold of each is 0."""
    imm, geometric, beam = (
        sweep(task, find_decider(name, task.options), tracks, seed)
        for name in ("threshold", "beam-geometric", "beam")
    )
    return {
        "IMM, the most probable mode": imm.at(0),
        "IMM, tuned threshold": imm,
        "beam, geometric law of durations": geometric,
        "beam, true law of durations": beam,
    }
