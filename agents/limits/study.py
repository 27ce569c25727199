"""Evaluation of the classical decision rules on every filter bank and noise level."""

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from agents.evaluation.deciders import ATE, CLASSICAL, DeciderFamily, bayes_family
from agents.evaluation.evaluate import evaluate, share_interval
from agents.evaluation.operating_curve import REWARD, Estimate, at_threshold, sweep, ticks_at_accuracy
from agents.interface.parallel import Call
from baselines.papers import golubkov2018
from baselines.rules import seeds
from baselines.rules.msprt import GapDecider
from baselines.rules.posterior_paths import (
    CalibrationSummary,
    simulate_posterior_paths,
    summarise_calibration,
)
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


def rule_calls(env_id: str, episodes: int, seed: int) -> dict[str, Call]:
    """Return the calls of `evaluate_rule` for every noise level, bank and rule, by what they evaluate.

    Args:
        env_id: registered id of the environment.
        episodes: number of episodes. A third as many others (at least 50) serve to select thresholds.
        seed: seed of the first episode.
    """
    return {
        f"{env_id.rpartition(':')[2]}, {bank}, {rule}, R = {noise:g}": functools.partial(
            evaluate_rule, env_id, noise, bank, rule, episodes, seed
        )
        for noise in NOISE_LEVELS
        for bank in BANKS
        for rule in RULES[env_id]
    }


def evaluate_rule(env_id: str, noise: float, bank: str, rule: str, episodes: int, seed: int) -> RuleResult:
    """Evaluate a rule on a bank at a noise level; see `rule_calls`."""
    options: dict[str, Any] = {"measurement_variance": noise, "bank": bank}
    family = _family(rule, env_id, options)
    selection = sweep(family, env_id, max(episodes // 3, 50), seeds.SELECTION, **options)
    best = selection.best_index()
    curve = sweep(family, env_id, episodes, seed, **options)
    return RuleResult(
        env_id, noise, bank, family.name,
        curve.estimate(ticks_at_accuracy(0.95)), curve.estimate(ticks_at_accuracy(0.98)),
        curve.estimate(at_threshold(REWARD, best)), family.thresholds[best],
    )  # fmt: skip


def _family(rule: str, env_id: str, options: dict[str, Any]) -> DeciderFamily:
    if rule == "bayes":
        return bayes_family(make_vector_env(env_id, 1, **options).options)
    return ATE if rule == "ate" else CLASSICAL[rule]


def calibration_calls(seed: int) -> dict[str, Call]:
    """Return the calls of `bank_calibration` for every bank and noise level, by what they simulate.

    Args:
        seed: seed of the first of `CALIBRATION_EPISODES` episodes.
    """
    return {
        f"calibration, {bank}, R = {noise:g}": functools.partial(bank_calibration, bank, noise, seed)
        for bank in CALIBRATION_BANKS
        for noise in NOISE_LEVELS
    }


def bank_calibration(bank: str, noise: float, seed: int) -> list[BankCalibration]:
    """Calibration of the most probable hypothesis of a bank at a noise level; see `calibration_calls`."""
    paths = simulate_posterior_paths(
        CALIBRATION_EPISODES, seed, measurement_variance=noise, **CALIBRATION_BANKS[bank]
    )
    return [
        BankCalibration(bank, noise, tick, summarise_calibration(paths, tick)) for tick in CALIBRATION_TICKS
    ]


def type_accuracy_calls(episodes: int, seed: int) -> dict[str, Call]:
    """Return the calls of `type_accuracy_golubkov2018` for every bank and noise level.

    Args:
        episodes: number of episodes.
        seed: seed of the first episode.
    """
    return {
        f"scheme of 2018, {bank}, R = {noise:g}": functools.partial(
            type_accuracy_golubkov2018, bank, noise, episodes, seed
        )
        for bank in BANKS[:2]
        for noise in NOISE_LEVELS
    }


def type_accuracy_golubkov2018(bank: str, noise: float, episodes: int, seed: int) -> TypeAccuracy:
    """Type accuracy of the gap rule on the scheme of Golubkov 2018, where ATE reaches 72 to 80 %."""
    decisions = evaluate(
        GapDecider(GAP_THRESHOLD), BANK_ENV, episodes, seed, scheme=golubkov2018.SCHEME,
        heading=math.pi / 2, initial_error=0, measurement_variance=noise, bank=bank,
    )  # fmt: skip
    shares = decisions.type_correct.mean(1)
    accuracy = Estimate(float(shares.mean()), *share_interval(shares))
    return TypeAccuracy(bank, noise, accuracy, float(np.mean(decisions.ticks)))
