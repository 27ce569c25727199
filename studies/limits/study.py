"""Rules with more and more information, on every filter bank and noise level."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from joblib import delayed

from agents import Task, find_decider, sweep, task_of
from baselines import (
    BeamDecider,
    Scores,
    Statements,
    ThresholdDecider,
    measure_statements,
    record_statements,
)
from studies.limits.smoother import BeamSmoother

# Three hypotheses and 21 of the published bank, and three with unknown switches.
THREE, BANK, QUICKEST = (
    f"HybridTrack{part}-v0" for part in ("Published", "PublishedBank", "Quickest")
)
# Thresholds are selected on episodes from this seed on; reported ones have smaller seeds.
SELECTION = 1_000_000_000
# R [m^2].
NOISE_LEVELS = (0.01, 0.1, 1.0)
BANKS = ("published", "anchor_aware", "oracle")
RULES = {
    THREE: ("ate", "msprt"),
    BANK: ("ate", "msprt-type", "msprt"),
}
# Decider and changed options of each step for announced switches, with more and more information.
STEPS: dict[str, tuple[str, dict[str, Any]]] = {
    "ATE on the published bank": ("ate", {}),
    "MSPRT: every hypothesis is compared with every other": ("msprt", {}),
    "the filters start from the covariance of the estimate": ("msprt-kept", {}),
    "the distribution of the anchor error is fitted in simulation": ("calibrated", {}),
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
# Of the durations of segments.
LAWS = ("25 + geometric 50", "uniform 50-100")
# Ticks.
LAGS = (5, 10, 20, 40)
IMM, THRESHOLD = "IMM, the most probable mode", "IMM, tuned threshold"
GEOMETRIC, BEAM = "beam, geometric law of durations", "beam, true law of durations"
LATER = {lag: f"with the measurements of {lag} later ticks (off line)" for lag in LAGS}
CALIBRATION_BANKS: dict[str, dict[str, Any]] = {
    "anchor-aware": {"bank": "anchor_aware"},
    "published, P kept": {"bank": "published", "reset_covariance": False},
    "published": {"bank": "published"},
    "oracle": {"bank": "oracle"},
}
# Of the figures of whole operating curves, by their keys in JSON.
TIMES = {f"time_{100 * level:.0f}": ("ticks_at_accuracy", f"{level:g}") for level in (0.95, 0.98)}

# A row of a table, as in JSON: place, noise level R [m^2], step or rule, threshold, and figures as
# `Estimate`.
Row = dict[str, Any]


def calls(unknown: bool, episodes: int, seed: int, quick: bool = False) -> dict[str, list[Any]]:
    """Return the `joblib.delayed` calls of the study by its parts; every call returns a list of
    rows.

    A third as many other episodes, at least 50, serve to select thresholds, those with the largest
    mean reward.

    Args:
        unknown: whether switch moments are unknown; else both environments with known ones are
            evaluated.
        episodes, seed: number of episodes, and seed of the first one.
        quick: whether only one noise level is evaluated, with three hypotheses or one law.
    """
    noises = NOISE_LEVELS[1:2] if quick else NOISE_LEVELS
    run = episodes, seed
    if unknown:
        laws = product(LAWS[1:] if quick else LAWS, noises)
        return {"steps": [delayed(unknown_steps)(*place, *run) for place in laws]}
    places = list(product([THREE] if quick else RULES, noises))
    return {
        "steps": [delayed(announced_steps)(*place, *run) for place in places],
        "rules": [
            delayed(rule_on_bank)(
                *place,
                bank,
                rule,
                *run,
            )
            for place in places
            for bank, rule in product(BANKS, RULES[place[0]])
        ],
        "calibration": [
            delayed(bank_calibration)(bank, noise, seed, 1000 if quick else 10_000)
            for bank, noise in product(CALIBRATION_BANKS, noises)
        ],
    }


def best_threshold(task: Task, decider: Any, episodes: int) -> int:
    """Return the index of the threshold with the best reward on a third as many other episodes."""
    return task.best(
        sweep(
            task,
            decider,
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
        decider = find_decider("msprt-type" if by_type else name, task.options)
        threshold = decider.thresholds[best_threshold(task, decider, episodes)]
        scores = sweep(
            task,
            decider,
            episodes,
            seed,
            thresholds=(threshold,),
        )
        row = {"place": env_id, "noise": noise, "step": step}
        rows.append(row | _reward(scores, task, before))
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
    # ATE itself brings the published bank.
    named = "sprt" if rule == "ate" and bank != "published" else rule
    decider = find_decider(named, task.options)
    best = best_threshold(task, decider, episodes)
    curve = sweep(task, decider, episodes, seed)
    row: Row = {
        "env_id": env_id,
        "noise": noise,
        "bank": bank,
        "rule": decider.title,
    }
    levels = task.levels(curve, decider.thresholds[best])
    row |= {name: curve.estimate(levels[key].statistic) for name, key in TIMES.items()}
    reward = curve.at(best).estimate(task.statistic("reward"))
    return [
        row
        | {
            "reward": reward,
            "threshold": decider.thresholds[best],
        }
    ]


def bank_calibration(bank: str, noise: float, seed: int, episodes: int) -> list[Row]:
    """Return the calibration of a bank at a noise level on HybridTrackPublished-v0."""
    options = {
        "measurement_variance": noise,
        **CALIBRATION_BANKS[bank],
    }
    rows = task_of(THREE, options).remarks(episodes, seed)["bank"]
    return [{"bank": bank, "noise": noise, **row} for row in rows]


def unknown_steps(law: str, noise: float, tracks: int, seed: int) -> list[Row]:
    """Evaluate every step for unknown switches for a law and a noise level, on the same tracks."""
    task = task_of(QUICKEST, {"durations": law, "measurement_variance": noise})
    selection = _curves(task, max(tracks // 3, 50), SELECTION)
    rows = []
    before = None
    for step, curve in _curves(task, tracks, seed).items():
        scores = curve.at(task.best(selection[step]))
        row = {"place": f"durations {law}", "noise": noise, "step": step}
        rows.append(row | _reward(scores, task, before))
        before = scores
    return rows


def _curves(task: Task, tracks: int, seed: int) -> dict[str, Scores]:
    """Return the scores of all steps; the first threshold of each is 0."""
    imm, geometric = (
        sweep(
            task,
            find_decider(name, task.options),
            tracks,
            seed,
        )
        for name in ("threshold", "beam-geometric")
    )
    beam, *later = smoothed_scores(
        task,
        tracks,
        seed,
        (0, *LAGS),
    )
    curves = {
        IMM: imm.at(0),
        THRESHOLD: imm,
        GEOMETRIC: geometric,
        BEAM: beam,
    }
    return curves | dict(zip(LATER.values(), later, strict=True))


def smoothed_scores(
    task: Task,
    tracks: int,
    seed: int,
    lags: Sequence[int],
    at_once: int = 500,
) -> list[Scores]:
    """Return the scores of the threshold rule on the posterior at each number of later ticks; 0 is
    the beam itself. A batch of 500 tracks needs about 100 MB.
    """
    decider = BeamDecider.create(task.options)
    figures: dict[int, list[Any]] = {lag: [] for lag in lags}
    for first in range(0, tracks, at_once):
        smoother = BeamSmoother(decider, lags)
        count = min(at_once, tracks - first)
        options = vars(task.options)
        true_modes, _ = record_statements(
            smoother,
            count,
            seed + first,
            **options,
        )
        for lag in lags:
            with np.errstate(divide="ignore"):
                log_probability = np.log(smoother.posterior(lag))
            stated = (
                ThresholdDecider(threshold).statements(log_probability)
                for threshold in decider.thresholds
            )
            cost = task.options.change_cost
            rewards = [
                measure_statements(Statements(true_modes, modes), cost).reward for modes in stated
            ]
            figures[lag].append(np.stack(rewards, axis=-1))
    scores = []
    for lag, parts in figures.items():
        name = f"{decider.title}, {lag} ticks later" if lag else decider.title
        values = np.concatenate(parts)[:, None]
        scores.append(Scores(name, decider.symbol, decider.thresholds, ("reward",), values))
    return scores
