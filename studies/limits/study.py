"""Rules with more and more information, on every filter bank and noise level."""

import functools
import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np

from agents import Task, find_family, sweep, task_of
from baselines import (
    BeamSmoother,
    GapDecider,
    Scores,
    Statements,
    ThresholdDecider,
    measure_statements,
    record_statements,
)

# Three hypotheses and 21 of the published bank, and three with unknown switches.
THREE, BANK, QUICKEST = (
    f"HybridTrack{part}-v0" for part in ("Published", "PublishedBank", "Quickest")
)
# Thresholds are selected on episodes from this seed on; reported ones have smaller seeds.
SELECTION = 1_000_000_000
# R [m^2].
NOISE_LEVELS = (0.01, 0.1, 1.0)
BANKS = ("published", "anchor_aware", "oracle")
RULES = {THREE: ("ate", "msprt", "bayes"), BANK: ("ate", "msprt-type", "msprt", "bayes")}
AWARE: dict[str, Any] = {"bank": "anchor_aware"}
STEPS: dict[str, tuple[str, dict[str, Any]]] = {
    "ATE on the published bank": ("ate", {}),
    "MSPRT: every hypothesis is compared with every other": ("msprt", {}),
    "the filters start from the covariance of the estimate": ("msprt-kept", {}),
    "the distribution of the anchor error is fitted in simulation": ("calibrated", {}),
    "MSPRT on the anchor-aware bank, which reads the full covariance": ("msprt-aware", AWARE),
    "all filters run on, and the next anchor is merged": (
        "msprt-aware",
        AWARE | {"follow": "bank"},
    ),
    "the anchor is exact (oracle, not available in practice)": ("msprt", {"bank": "oracle"}),
}
"""Decider and changed options of each step for announced switches, in the order of their
information.
"""

LAWS = ("25 + geometric 50", "uniform 50-100")
# Ticks.
LAGS = (5, 10, 20, 40)
# In a batch, which needs about 100 MB.
SMOOTHED_TRACKS = 500
IMM, THRESHOLD = "IMM, the most probable mode", "IMM, tuned threshold"
GEOMETRIC, BEAM = "beam, geometric law of durations", "beam, true law of durations"
LATER = {lag: f"with the measurements of {lag} later ticks (off line)" for lag in LAGS}

CALIBRATION_BANKS: dict[str, dict[str, Any]] = {
    "anchor-aware": {"bank": "anchor_aware"},
    "published, P kept": {"bank": "published", "reset_covariance": False},
    "published": {"bank": "published"},
    "oracle": {"bank": "oracle"},
}
CALIBRATION_EPISODES = 10_000
GAP_THRESHOLD = math.log(99.0)
# Of the figures of whole operating curves, by their keys in JSON.
TIMES = {f"time_{100 * level:.0f}": ("ticks_at_accuracy", f"{level:g}") for level in (0.95, 0.98)}

Call = Callable[[], "list[Row]"]
Row = dict[str, Any]
"""A row of a table, as in JSON: place, noise level R [m^2], step or rule, threshold, and figures
as `Estimate`.
"""


def calls(
    unknown: bool,
    episodes: int,
    seed: int,
    further: Sequence[str] = (),
    quick: bool = False,
) -> dict[str, list[Call]]:
    """Return the calls of the study by its parts; every call returns a list of rows.

    A third as many other episodes, at least 50, serve to select thresholds, those with the largest
    mean reward.

    Args:
        unknown: whether switch moments are unknown; else both environments with known ones are
            evaluated, with `further` deciders on every bank.
        episodes, seed: number of episodes, and seed of the first one.
        further: names of deciders.
        quick: whether only one noise level is evaluated, with three hypotheses or one law.
    """
    call = functools.partial
    noises = NOISE_LEVELS[1:2] if quick else NOISE_LEVELS
    if unknown:
        laws = product(LAWS[1:] if quick else LAWS, noises)
        return {
            "steps": [
                call(
                    unknown_steps,
                    law,
                    noise,
                    episodes,
                    seed,
                )
                for law, noise in laws
            ]
        }
    places = list(product([THREE] if quick else RULES, noises))
    rules: list[Call] = [
        call(
            rule_on_bank,
            env_id,
            noise,
            bank,
            rule,
            episodes,
            seed,
        )
        for env_id, noise in places
        for bank, rule in product(BANKS, (*RULES[env_id], *further))
    ]
    return {
        "steps": [
            call(
                announced_steps,
                env_id,
                noise,
                episodes,
                seed,
            )
            for env_id, noise in places
        ],
        "rules": rules,
        "calibration": [
            call(bank_calibration, bank, noise, seed)
            for bank, noise in product(CALIBRATION_BANKS, noises)
        ],
        "golubkov2018": [
            call(
                type_accuracy_golubkov2018,
                bank,
                noise,
                episodes,
                seed,
            )
            for bank, noise in product(BANKS[:2], noises)
        ],
    }


def best_threshold(task: Task, family: Any, episodes: int) -> int:
    """Return the index of the threshold with the best reward on a third as many other episodes."""
    return task.best(
        sweep(
            task,
            family,
            max(episodes // 3, 50),
            SELECTION,
        )
    )


def _reward(scores: Scores, task: Task, before: Scores | None) -> Row:
    """Return threshold and reward of scores at one threshold, and the gain of reward over the
    step before.
    """
    gain = None if before is None else scores.difference(before, task.statistic(task.goal))
    return {
        "threshold": scores.thresholds[0],
        "reward": scores.estimate(task.statistic("reward")),
        "gain": gain,
    }


def announced_steps(env_id: str, noise: float, episodes: int, seed: int) -> list[Row]:
    """Evaluate every step for announced switches at a noise level."""
    rows = []
    before = None
    for step, (name, changes) in STEPS.items():
        task = task_of(env_id, {"measurement_variance": noise, **changes})
        by_type = name == "msprt" and task.options.correctness == "type"
        family = find_family("msprt-type" if by_type else name, task.options)
        threshold = family.thresholds[best_threshold(task, family, episodes)]
        scores = sweep(
            task,
            family,
            episodes,
            seed,
            thresholds=(threshold,),
        )
        place = {
            "env_id": env_id,
            "noise": noise,
            "step": step,
        }
        rows.append(place | _reward(scores, task, before))
        before = scores
    return rows


def rule_on_bank(
    env_id: str,
    noise: float,
    bank: str,
    rule: str,
    episodes: int,
    seed: int,
) -> list[Row]:
    """Evaluate a rule on a bank at a noise level, at all thresholds."""
    task = task_of(env_id, {"measurement_variance": noise, "bank": bank})
    family = find_family(rule, task.options)
    best = best_threshold(task, family, episodes)
    curve = sweep(task, family, episodes, seed)
    row: Row = {
        "env_id": env_id,
        "noise": noise,
        "bank": bank,
        "rule": family.name,
    }
    levels = task.levels(curve, family.thresholds[best])
    row |= {name: curve.estimate(levels[key].statistic) for name, key in TIMES.items()}
    reward = curve.at(best).estimate(task.statistic("reward"))
    return [row | {"reward": reward, "threshold": family.thresholds[best]}]


def bank_calibration(bank: str, noise: float, seed: int) -> list[Row]:
    """Return the calibration of a bank at a noise level on HybridTrackPublished-v0."""
    options = {"measurement_variance": noise, **CALIBRATION_BANKS[bank]}
    rows = task_of(THREE, options).remarks(CALIBRATION_EPISODES, seed)["bank"]
    return [
        {
            "bank": bank,
            "noise": noise,
            **row,
        }
        for row in rows
    ]


def type_accuracy_golubkov2018(bank: str, noise: float, episodes: int, seed: int) -> list[Row]:
    """Return the gap rule at ln 99 on the scheme of Golubkov 2018, where ATE is right in 72-80
    %.
    """
    options = {
        "scheme": "golubkov2018",
        "heading": math.pi / 2,
        "initial_error": 0,
    }
    task = task_of(BANK, options | {"measurement_variance": noise, "bank": bank})
    scores = sweep(
        task,
        GapDecider.family(task.options),
        episodes,
        seed,
        thresholds=(GAP_THRESHOLD,),
    )
    accuracy = scores.estimate(task.statistic("type_accuracy"))
    ticks = float(scores.curve(task.statistic("ticks"))[0])
    return [
        {
            "bank": bank,
            "noise": noise,
            "accuracy": accuracy,
            "ticks": ticks,
        }
    ]


def unknown_steps(law: str, noise: float, tracks: int, seed: int) -> list[Row]:
    """Evaluate every step for unknown switches for a law and a noise level, on the same tracks."""
    task = task_of(QUICKEST, {"durations": law, "measurement_variance": noise})
    selection = _curves(task, max(tracks // 3, 50), SELECTION)
    rows = []
    before = None
    for step, curve in _curves(task, tracks, seed).items():
        scores = curve.at(task.best(selection[step]))
        row = {
            "law": law,
            "noise": noise,
            "step": step,
        } | _reward(scores, task, before)
        for key, name in (
            ("delay", "full_delay"),
            ("wrong_changes", "wrong_changes"),
        ):
            row[key] = scores.estimate(task.statistic(name))
        row["most_probable_right"] = curve.at(0).estimate(task.statistic("right"))
        rows.append(row)
        before = scores
    return rows


def _curves(task: Task, tracks: int, seed: int) -> dict[str, Scores]:
    """Return the scores of all steps; the first threshold of each is 0."""
    imm, geometric = (
        sweep(
            task,
            find_family(name, task.options),
            tracks,
            seed,
        )
        for name in ("threshold", "beam-geometric")
    )
    smoothed = smoothed_scores(
        task,
        tracks,
        seed,
        (0, *LAGS),
    )
    curves = {
        IMM: imm.at(0),
        THRESHOLD: imm,
        GEOMETRIC: geometric,
        BEAM: smoothed[0],
    }
    return curves | {LATER[lag]: smoothed[lag] for lag in LAGS}


def smoothed_scores(
    task: Task,
    tracks: int,
    seed: int,
    lags: Sequence[int],
) -> dict[int, Scores]:
    """Return the scores of the threshold rule on the posterior at later ticks, by lag; 0 is the
    beam itself.
    """
    family = find_family("beam", task.options)
    figures: dict[int, list[Any]] = {lag: [] for lag in lags}
    for first in range(0, tracks, SMOOTHED_TRACKS):
        smoother = BeamSmoother(family.make(family.default), lags)
        count = min(SMOOTHED_TRACKS, tracks - first)
        true_modes, _ = record_statements(
            smoother,
            count,
            seed + first,
            **vars(task.options),
        )
        for lag in lags:
            with np.errstate(divide="ignore"):
                log_probability = np.log(smoother.posterior(lag))
            stated = (
                ThresholdDecider(threshold).statements(log_probability)
                for threshold in family.thresholds
            )
            cost = task.options.change_cost
            metrics = [measure_statements(Statements(true_modes, modes), cost) for modes in stated]
            figures[lag].append(np.stack([each.figures for each in metrics], axis=-1))
    scores = {}
    for lag, parts in figures.items():
        name = f"{family.name}, {lag} ticks later" if lag else family.name
        values = np.concatenate(parts)
        columns = task.columns[: values.shape[1]]
        scores[lag] = Scores(
            name,
            family.symbol,
            family.thresholds,
            columns,
            values,
        )
    return scores
