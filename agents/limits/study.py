"""How soon the modes can be told apart: every classical rule on every bank, over the noise."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from agents.evaluation import seeds
from agents.evaluation.deciders import ATE, CLASSICAL, DeciderFamily, bayes_family
from agents.evaluation.evaluate import confidence_interval, evaluate
from agents.evaluation.operating_curve import REWARD, Estimate, at_threshold, sweep, ticks_at_accuracy
from baselines.deciders.msprt import GapDecider
from baselines.deciders.posterior_paths import (
    CalibrationSummary,
    simulate_posterior_paths,
    summarise_calibration,
)
from baselines.papers import golubkov2018
from hybrid_env.registration import make_vector_env

SINGLE, BANK = "hybrid_env:HybridTrack-v0", "hybrid_env:HybridTrackBank-v0"
NOISE = (0.01, 0.1, 1.0)  # R [m^2]
BANKS = ("published", "anchor_aware", "oracle")
RULES = {SINGLE: ("ate", "msprt", "bayes"), BANK: ("ate", "msprt-type", "msprt", "bayes")}
STATEMENTS: dict[str, dict[str, Any]] = {
    "anchor-aware": {"bank": "anchor_aware"},
    "published, P kept": {"bank": "published", "reset_covariance": False},
    "published": {"bank": "published"},
    "oracle": {"bank": "oracle"},
}
STATEMENT_TICKS = (2, 5, 10, 20, 40)
STATEMENT_EPISODES = 10_000
GAP = math.log(99.0)


@dataclass(frozen=True)
class Limit:
    """One rule on one bank at one noise.

    Attributes:
        env_id, noise, bank, rule: what was measured.
        time_95, time_98: mean ticks at that accuracy.
        reward: a segment, at the threshold chosen on other episodes.
        threshold: that one.
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
class Stated:
    """What a bank says after some ticks, all waiting, on HybridTrack-v0."""

    bank: str
    noise: float
    tick: int
    statement: CalibrationSummary


@dataclass(frozen=True)
class Classes:
    """Share of right types of the gap rule at ln 99 on the scheme of Golubkov 2018, and its mean ticks."""

    bank: str
    noise: float
    right: Estimate
    ticks: float


def rules_on_banks(env_id: str, episodes: int, seed: int, on_progress: Callable[[str], None]) -> list[Limit]:
    """Every rule on every bank; episodes are the same for all, thresholds are chosen on others."""
    found = []
    for noise in NOISE:
        for bank in BANKS:
            options: dict[str, Any] = {"measurement_variance": noise, "bank": bank}
            for rule in RULES[env_id]:
                family = _family(rule, env_id, options)
                selection = sweep(family, env_id, max(episodes // 3, 50), seeds.SELECTION, **options)
                best = selection.best_index()
                curve = sweep(family, env_id, episodes, seed, **options)
                found.append(
                    Limit(
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


def statements(seed: int, on_progress: Callable[[str], None]) -> list[Stated]:
    """Stated and actual probability of the likeliest hypothesis."""
    found = []
    for bank, options in STATEMENTS.items():
        for noise in NOISE:
            paths = simulate_posterior_paths(STATEMENT_EPISODES, seed, measurement_variance=noise, **options)
            found += [
                Stated(bank, noise, tick, summarise_calibration(paths, tick)) for tick in STATEMENT_TICKS
            ]
            on_progress(f"calibration, {bank}, R = {noise:g}")
    return found


def classes_2018(episodes: int, seed: int, on_progress: Callable[[str], None]) -> list[Classes]:
    """The gap rule where ATE has 72 to 80 % of the types right."""
    found = []
    for bank in BANKS[:2]:
        for noise in NOISE:
            decisions = evaluate(
                GapDecider(GAP), BANK, episodes, seed, scheme=golubkov2018.SCHEME, heading=math.pi / 2,
                initial_error=0, measurement_variance=noise, bank=bank,
            )  # fmt: skip
            share = decisions.type_correct.mean(1)
            right = Estimate(float(share.mean()), *confidence_interval(share))
            found.append(Classes(bank, noise, right, float(np.mean(decisions.ticks))))
            on_progress(f"scheme of 2018, {bank}, R = {noise:g}")
    return found
