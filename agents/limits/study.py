"""Evaluation of the classical decision rules on every filter bank and noise level."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from agents.evaluation import seeds
from agents.evaluation.deciders import ATE, CLASSICAL, DeciderFamily, bayes_family
from agents.evaluation.evaluate import evaluate, share_interval
from agents.evaluation.operating_curve import REWARD, Estimate, at_threshold, sweep, ticks_at_accuracy
from baselines.deciders.msprt import GapDecider
from baselines.deciders.posterior_paths import (
    CalibrationSummary,
    simulate_posterior_paths,
    summarise_calibration,
)
from baselines.papers import golubkov2018
from hybrid_env.registration import make_vector_env

THREE_MODE_ENV, BANK_ENV = "hybrid_env:HybridTrack-v0", "hybrid_env:HybridTrackBank-v0"
NOISE_LEVELS = (0.01, 0.1, 1.0)  # R [m^2]
BANKS = ("published", "anchor_aware", "oracle")
RULES = {
    THREE_MODE_ENV: ("ate", "msprt", "bayes"),
    BANK_ENV: ("ate", "msprt-type", "msprt", "bayes"),
}
CALIBRATION_BANKS: dict[str, dict[str, Any]] = {
    "anchor-aware": {"bank": "anchor_aware"},
    "published, P kept": {"bank": "published", "reset_covariance": False},
    "published": {"bank": "published"},
    "oracle": {"bank": "oracle"},
}
CALIBRATION_TICKS = (2, 5, 10, 20, 40)
CALIBRATION_EPISODES = 10_000
GAP_THRESHOLD = math.log(99.0)


@dataclass(frozen=True)
class RuleResult:
    """Results of one rule on one bank at one noise level.

    Attributes:
        env_id: registered id of the environment.
        noise: variance R of a measured coordinate [m^2].
        bank: filter bank.
        rule: name of the decider.
        time_95: mean decision time at 95 % accuracy, in ticks.
        time_98: mean decision time at 98 % accuracy, in ticks.
        reward: mean reward per segment at the selected threshold.
        threshold: threshold with the largest mean reward on other episodes.
    """

    env_id: str
    noise: float
    bank: str
    rule: str
    time_95: Estimate
    time_98: Estimate
    reward: Estimate
    threshold: float


@dataclass(frozen=True)
class BankCalibration:
    """Calibration of a bank after a number of ticks without a decision, on HybridTrack-v0.

    Attributes:
        bank: filter bank.
        noise: variance R of a measured coordinate [m^2].
        tick: ticks since the start of the segment.
        calibration: accuracy, mean posterior and largest calibration error.
    """

    bank: str
    noise: float
    tick: int
    calibration: CalibrationSummary


@dataclass(frozen=True)
class TypeAccuracy:
    """Result of the gap rule at ln 99 on the scheme of Golubkov 2018.

    Attributes:
        bank: filter bank.
        noise: variance R of a measured coordinate [m^2].
        accuracy: share of segments with the correct type: straight, left or right.
        ticks: mean decision time.
    """

    bank: str
    noise: float
    accuracy: Estimate
    ticks: float


def evaluate_rules(
    env_id: str, episodes: int, seed: int, on_progress: Callable[[str], None]
) -> list[RuleResult]:
    """Evaluate every rule on every bank and noise level on the same episodes.

    Args:
        env_id: registered id of the environment.
        episodes: number of episodes. A third as many others (at least 50) serve to select thresholds.
        seed: seed of the first episode.
        on_progress: called with a note after each rule.
    """
    found = []
    for noise in NOISE_LEVELS:
        for bank in BANKS:
            options: dict[str, Any] = {"measurement_variance": noise, "bank": bank}
            for rule in RULES[env_id]:
                family = _family(rule, env_id, options)
                selection = sweep(family, env_id, max(episodes // 3, 50), seeds.SELECTION, **options)
                best = selection.best_index()
                curve = sweep(family, env_id, episodes, seed, **options)
                found.append(
                    RuleResult(
                        env_id, noise, bank, family.name,
                        curve.estimate(ticks_at_accuracy(0.95)), curve.estimate(ticks_at_accuracy(0.98)),
                        curve.estimate(at_threshold(REWARD, best)), family.thresholds[best],
                    )
                )  # fmt: skip
                on_progress(f"{bank}, {family.name}, R = {noise:g}")
    return found


def _family(rule: str, env_id: str, options: dict[str, Any]) -> DeciderFamily:
    if rule == "bayes":
        return bayes_family(make_vector_env(env_id, 1, **options).options)
    return ATE if rule == "ate" else CLASSICAL[rule]


def bank_calibration(seed: int, on_progress: Callable[[str], None]) -> list[BankCalibration]:
    """Calibration of the most probable hypothesis for every bank and noise level.

    Args:
        seed: seed of the first of `CALIBRATION_EPISODES` episodes.
        on_progress: called with a note after each bank and noise level.
    """
    found = []
    for bank, options in CALIBRATION_BANKS.items():
        for noise in NOISE_LEVELS:
            paths = simulate_posterior_paths(
                CALIBRATION_EPISODES, seed, measurement_variance=noise, **options
            )
            found += [
                BankCalibration(bank, noise, tick, summarise_calibration(paths, tick))
                for tick in CALIBRATION_TICKS
            ]
            on_progress(f"calibration, {bank}, R = {noise:g}")
    return found


def type_accuracy_golubkov2018(
    episodes: int, seed: int, on_progress: Callable[[str], None]
) -> list[TypeAccuracy]:
    """Type accuracy of the gap rule on the scheme of Golubkov 2018, where ATE reaches 72 to 80 %.

    Args:
        episodes: number of episodes.
        seed: seed of the first episode.
        on_progress: called with a note after each bank and noise level.
    """
    found = []
    for bank in BANKS[:2]:
        for noise in NOISE_LEVELS:
            decisions = evaluate(
                GapDecider(GAP_THRESHOLD), BANK_ENV, episodes, seed, scheme=golubkov2018.SCHEME,
                heading=math.pi / 2, initial_error=0, measurement_variance=noise, bank=bank,
            )  # fmt: skip
            shares = decisions.type_correct.mean(1)
            accuracy = Estimate(float(shares.mean()), *share_interval(shares))
            found.append(TypeAccuracy(bank, noise, accuracy, float(np.mean(decisions.ticks))))
            on_progress(f"scheme of 2018, {bank}, R = {noise:g}")
    return found
