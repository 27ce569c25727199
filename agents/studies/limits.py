"""What limits a decision: rules with more and more information, on every filter bank and noise level."""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from agents.evaluation.announced import AnnouncedTask, calibration_rows
from agents.evaluation.registry import find_family
from agents.evaluation.task import Task, gather, sweep
from agents.evaluation.tasks import BANK, QUICKEST, THREE, task_of
from agents.evaluation.unknown import UnknownTask
from agents.interface.parallel import Call
from baselines.papers import golubkov2018
from baselines.rules import seeds
from baselines.rules.beam import BeamDecider
from baselines.rules.beam_smoother import BeamSmoother
from baselines.rules.decider import DeciderFamily
from baselines.rules.msprt import GapDecider
from baselines.rules.rollout import record_statements
from baselines.rules.threshold import ThresholdDecider
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores, at_level, mean
from baselines.scoring.statements import STATISTICS, Statements
from hybrid_env.quickest_options import QuickestOptions

NOISE_LEVELS = (0.01, 0.1, 1.0)  # R [m^2]
BANKS = ("published", "anchor_aware", "oracle")
RULES = {THREE: ("ate", "msprt", "bayes"), BANK: ("ate", "msprt-type", "msprt", "bayes")}
AWARE: dict[str, Any] = {"bank": "anchor_aware"}
STEPS: dict[str, tuple[str, dict[str, Any]]] = {
    "ATE on the published bank": ("ate", {}),
    "MSPRT: every hypothesis is compared with every other": ("msprt", {}),
    "the filters start from the covariance of the estimate": ("msprt-kept", {}),
    "the distribution of the anchor error is fitted in simulation": ("calibrated", {}),
    "MSPRT on the anchor-aware bank, which reads the full covariance": ("msprt-aware", AWARE),
    "all filters run on, and the next anchor is merged": ("msprt-aware", AWARE | {"follow": "bank"}),
    "the anchor is exact (oracle, not available in practice)": ("msprt", {"bank": "oracle"}),
}
"""Decider and changed options of each step for announced switches, in the order of their information."""

LAWS = ("25 + geometric 50", "uniform 50-100")
LAGS = (5, 10, 20, 40)  # ticks
SMOOTHED_TRACKS = 500  # in a batch, which needs about 100 MB
IMM, THRESHOLD = "IMM, the most probable mode", "IMM, tuned threshold"
GEOMETRIC, BEAM = "beam, geometric law of durations", "beam, true law of durations"
LATER = {lag: f"with the measurements of {lag} later ticks (off line)" for lag in LAGS}
UNKNOWN_STEPS = (IMM, THRESHOLD, GEOMETRIC, BEAM, *LATER.values())
"""The steps for unknown switches, in the order of their information."""

CALIBRATION_BANKS: dict[str, dict[str, Any]] = {
    "anchor-aware": {"bank": "anchor_aware"},
    "published, P kept": {"bank": "published", "reset_covariance": False},
    "published": {"bank": "published"},
    "oracle": {"bank": "oracle"},
}
CALIBRATION_EPISODES = 10_000
GAP_THRESHOLD = math.log(99.0)
TIMES = {f"time_{100 * level:.0f}": at_level("accuracy", level, mean("ticks")) for level in (0.95, 0.98)}
"""Mean decision times at two accuracies, by their keys in JSON."""


@dataclass(frozen=True, eq=False)
class Limit:
    """Figures of one rule in one environment."""

    place: str  # environment, and for unknown switches law of the durations
    noise: float  # variance R of a measured coordinate [m^2]
    row: str  # step or rule
    scores: Scores  # at the threshold with the largest mean reward on other episodes
    bank: str = ""  # filter bank of a rule; empty for a step
    curve: Scores | None = None  # at all thresholds, where they are of interest

    @property
    def threshold(self) -> float:
        """The selected threshold."""
        return self.scores.thresholds[0]


def calls(env_id: str, episodes: int, seed: int, further: Sequence[Any] = ()) -> dict[str, dict[str, Call]]:
    """Return the calls of a study by its parts; every call returns a list of results.

    Without an environment, both with announced switches are evaluated, `further` deciders on every bank. A third as
    many other episodes, at least 50, serve to select thresholds.
    """
    call = functools.partial
    if env_id == QUICKEST:
        laws = product(LAWS, NOISE_LEVELS)
        return {"steps": {f"{law}, R = {R:g}": call(unknown_steps, law, R, episodes, seed) for law, R in laws}}
    parts: dict[str, dict[str, Call]] = {"steps": {}, "rules": {}, "calibration": {}, "golubkov2018": {}}
    for env, noise in product(RULES, NOISE_LEVELS):
        title, level = env.rpartition(":")[2], f"R = {noise:g}"
        for step in STEPS:
            parts["steps"][f"{title}, {step}, {level}"] = call(announced_step, env, noise, step, episodes, seed)
        for bank, rule in product(BANKS, (*RULES[env], *further)):
            name = f"{title}, {bank}, {rule}, {level}"
            parts["rules"][name] = call(rule_on_bank, env, noise, bank, rule, episodes, seed)
    for bank, noise in product(CALIBRATION_BANKS, NOISE_LEVELS):
        parts["calibration"][f"calibration, {bank}, R = {noise:g}"] = call(bank_calibration, bank, noise, seed)
    for bank, noise in product(BANKS[:2], NOISE_LEVELS):
        name = f"scheme of 2018, {bank}, R = {noise:g}"
        parts["golubkov2018"][name] = call(type_accuracy_golubkov2018, bank, noise, episodes, seed)
    return parts


def best_threshold(task: Task, family: DeciderFamily, episodes: int) -> int:
    """Return the index of the threshold with the best reward on a third as many other episodes."""
    return task.best(sweep(task, family, max(episodes // 3, 50), seeds.SELECTION))


def announced_step(env_id: str, noise: float, step: str, episodes: int, seed: int) -> list[Limit]:
    """Evaluate a step for announced switches at a noise level."""
    name, changes = STEPS[step]
    task = task_of(env_id, {"measurement_variance": noise, **changes})
    by_type = name == "msprt" and task.options.correctness == "type"
    family = find_family("msprt-type" if by_type else name, task.options)
    threshold = family.thresholds[best_threshold(task, family, episodes)]
    return [Limit(env_id, noise, step, sweep(task, family, episodes, seed, thresholds=(threshold,)))]


def rule_on_bank(env_id: str, noise: float, bank: str, rule: str, episodes: int, seed: int) -> list[Limit]:
    """Evaluate a rule on a bank at a noise level, at all thresholds."""
    task = task_of(env_id, {"measurement_variance": noise, "bank": bank})
    family = find_family(rule, task.options)
    best = best_threshold(task, family, episodes)
    curve = sweep(task, family, episodes, seed)
    return [Limit(env_id, noise, family.name, curve.at(best), bank, curve)]


def bank_calibration(bank: str, noise: float, seed: int) -> list[dict[str, Any]]:
    """Return the calibration of a bank at a noise level on HybridTrack-v0."""
    options = {"measurement_variance": noise, **CALIBRATION_BANKS[bank]}
    rows = calibration_rows(CALIBRATION_EPISODES, seed, options)
    return [{"bank": bank, "noise": noise, **row} for row in rows]


def type_accuracy_golubkov2018(bank: str, noise: float, episodes: int, seed: int) -> list[Limit]:
    """Return the gap rule at ln 99 on the scheme of Golubkov 2018, where ATE is right in 72-80 %."""
    options = {"scheme": golubkov2018.SCHEME, "heading": math.pi / 2, "initial_error": 0}
    task = AnnouncedTask(BANK, options | {"measurement_variance": noise, "bank": bank})
    scores = sweep(task, GapDecider.family(task.options), episodes, seed, thresholds=(GAP_THRESHOLD,))
    return [Limit(BANK, noise, scores.name, scores, bank)]


def unknown_steps(law: str, noise: float, tracks: int, seed: int) -> list[Limit]:
    """Evaluate every step for unknown switches for a law and a noise level, on the same tracks."""
    task = UnknownTask(QUICKEST, {"durations": law, "measurement_variance": noise})
    selection = _curves(task, max(tracks // 3, 50), seeds.SELECTION)
    return [
        Limit(law, noise, step, curve.at(task.best(selection[step])), curve=curve.at(0))
        for step, curve in _curves(task, tracks, seed).items()
    ]


def _curves(task: UnknownTask, tracks: int, seed: int) -> dict[str, Scores]:
    """Return the scores of all steps; the first threshold of each is 0."""
    imm, geometric = (
        sweep(task, find_family(name, task.options), tracks, seed) for name in ("threshold", "beam-geometric")
    )
    smoothed = smoothed_scores(task, tracks, seed, (0, *LAGS))
    curves = {IMM: imm.at(0), THRESHOLD: imm, GEOMETRIC: geometric, BEAM: smoothed[0]}
    return curves | {LATER[lag]: smoothed[lag] for lag in LAGS}


def smoothed_scores(task: UnknownTask, tracks: int, seed: int, lags: Sequence[int]) -> dict[int, Scores]:
    """Return the scores of the threshold rule on the posterior at later ticks, by lag; 0 is the beam itself."""
    options: QuickestOptions = task.options
    family = BeamDecider.family(options)
    parts: dict[int, list[Any]] = {lag: [[] for _ in family.thresholds] for lag in lags}
    for first in range(0, tracks, SMOOTHED_TRACKS):
        smoother = BeamSmoother(family.make(family.default), lags)
        count = min(SMOOTHED_TRACKS, tracks - first)
        true_modes, _ = record_statements(smoother, count, seed + first, **vars(options))
        for lag in lags:
            with np.errstate(divide="ignore"):
                log_probability = np.log(smoother.posterior(lag))
            for found, threshold in zip(parts[lag], family.thresholds, strict=True):
                stated = ThresholdDecider(threshold).statements(log_probability)
                found.append(task.measured(Statements(true_modes, stated)))
    names = {lag: f"{family.name}, {lag} ticks later" if lag else family.name for lag in lags}
    named = {lag: replace(family, name=name) for lag, name in names.items()}
    return {lag: gather(task, named[lag], family.thresholds, found) for lag, found in parts.items()}


def gains(found: Sequence[Limit], task: type[Task]) -> list[tuple[Limit, Estimate | None]]:
    """Return steps with their gain of reward over the step before; None for the first."""
    goal = next(metric.statistic for metric in task.metrics if metric.name == task.goal)
    results: list[tuple[Limit, Estimate | None]] = []
    for before, now in zip((None, *found), found, strict=False):
        same = before is not None and (before.place, before.noise) == (now.place, now.noise)
        results.append((now, now.scores.difference(before.scores, goal) if before is not None and same else None))
    return results


def limits_json(parts: Mapping[str, Sequence[Any]]) -> dict[str, Any]:
    """Return the results of all parts as plain values."""
    announced = "rules" in parts
    place = "env_id" if announced else "law"
    reward = mean("reward")
    found: dict[str, Any] = {"steps": []}
    for one, gain in gains(parts["steps"], AnnouncedTask if announced else UnknownTask):
        step = {
            place: one.place, "noise": one.noise, "step": one.row, "threshold": one.threshold,
            "reward": one.scores.estimate(reward).as_json(), "gain": None if gain is None else gain.as_json(),
        }  # fmt: skip
        if not announced and one.curve is not None:
            for key, name in (("delay", "full_delay"), ("wrong_changes", "wrong_changes")):
                step[key] = one.scores.estimate(STATISTICS[name]).as_json()
            step["most_probable_right"] = one.curve.estimate(STATISTICS["right"]).as_json()
        found["steps"].append(step)
    if announced:
        accuracy = mean("type_accuracy", share=True)
        found["rules"] = [
            {"env_id": one.place, "noise": one.noise, "bank": one.bank, "rule": one.row}
            | {name: one.curve.estimate(time).as_json() for name, time in TIMES.items() if one.curve is not None}
            | {"reward": one.scores.estimate(reward).as_json(), "threshold": one.threshold}
            for one in parts["rules"]
        ]
        found["calibration"] = list(parts["calibration"])
        found["golubkov2018"] = [
            {
                "bank": one.bank, "noise": one.noise, "accuracy": one.scores.estimate(accuracy).as_json(),
                "ticks": float(one.scores.curve(mean("ticks"))[0]),
            }
            for one in parts["golubkov2018"]
        ]  # fmt: skip
    return found
