"""A threshold with hysteresis on the probabilities of the bank."""

import math
from typing import Any, Self

import numpy as np

from baselines.rules.decider import UNKNOWN, Actions, Observations, RowRule
from hybrid_env.checks import BoolArray, FloatArray, IntArray, UnitInterval, checked
from hybrid_env.observation import QuickestLayout
from hybrid_env.rendering.evidence import EvidencePanel, probability_panel

PROBABILITIES = (
    0.0,
    0.1,
    0.2,
    0.3,
    0.4,
    0.45,
    0.5,
    0.55,
    0.6,
    0.65,
    0.7,
    0.75,
    0.8,
    0.85,
    0.9,
    0.95,
    0.98,
    0.99,
    0.999,
)
"""Thresholds of the probability to sweep."""


def reachable_probabilities(hypotheses: int) -> tuple[float, ...]:
    """Return thresholds on the largest probability of M modes, which is never below 1 / M."""
    return tuple(p for p in PROBABILITIES if p == 0.0 or p > 1.0 / hypotheses)


def state_modes(
    log_probability: FloatArray,
    stated: Actions,
    started: BoolArray,
    threshold: float,
    release: float,
) -> Actions:
    """Return the next statements of N tracks, (N,), see `ThresholdDecider`.

    Args:
        log_probability: (N, M) logarithms of the probabilities of the modes.
        stated: (N,) last statements.
        started: (N,) False where none has been made; it is then the most probable mode.
        threshold, release: probabilities.
    """
    best = log_probability.argmax(-1)
    tracks = np.arange(len(stated))
    changes = log_probability[tracks, best] >= _logarithm(threshold)
    changes &= log_probability[tracks, stated] <= _logarithm(release)
    return np.where(changes | ~started, best, stated)


def _logarithm(probability: float) -> float:
    return math.log(probability) if probability > 0.0 else -math.inf


class ThresholdDecider(RowRule):
    """Changes its statement to the most probable mode when that is probable enough.

    Between the two thresholds the last statement is kept, so that it does not alternate between two
    probable modes.

    Args:
        threshold: smallest probability of a mode to which the statement changes, 0 to 1.
        release: largest probability of the stated mode at which the statement may change, 0 to 1; 1
            has no effect.
    """

    name = "threshold"
    task = UNKNOWN
    title = "IMM threshold"
    symbol = "probability"
    default = 0.6
    bounds = 0.0, 1.0

    def __init__(self, threshold: float = 0.6, release: float = 1.0):
        super().__init__(threshold)
        self.release = checked("release", release, UnitInterval)

    @classmethod
    def create(cls, options: Any, **arguments: Any) -> Self:
        """See `Decider.create`."""
        thresholds = reachable_probabilities(options.hypotheses)
        return super().create(options, **arguments).changed(thresholds=thresholds)

    def act(self, rows: Observations) -> Actions:
        """See `RowRule.act`; rows of `hybrid_env.HybridTrackQuickestEnv` have the last
        statement.
        """
        log_probability = QuickestLayout.of_rows(rows).read(rows, "log_probability")
        return state_modes(log_probability, *read_statement(rows), self.threshold, self.release)

    def panel(self) -> EvidencePanel:
        """Return the panel of `evidence`."""
        return probability_panel("bank", self.threshold)

    def statements(self, log_probability: FloatArray) -> IntArray:
        """Return the statements (T, N) at every tick, from log probabilities (T, N, M)."""
        stated = np.zeros(log_probability.shape[:2], int)
        for tick, values in enumerate(log_probability):
            started = np.full(len(values), tick > 0)
            thresholds = self.threshold, self.release
            stated[tick] = state_modes(values, stated[tick - 1], started, *thresholds)
        return stated


def read_statement(observation: Observations) -> tuple[Actions, BoolArray]:
    """Return the last stated mode of N tracks, (N,), and whether there has been a statement,
    (N,).
    """
    stated = QuickestLayout.of_rows(observation).read(observation, "stated")
    return stated.argmax(-1), stated.max(-1) > 0.0
