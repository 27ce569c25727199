"""A threshold on the probabilities of the bank."""

import math
from typing import Any, Self

import numpy as np

from baselines.rules.decider import UNKNOWN, Actions, Decider, Observations
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.observation import QuickestLayout


def reachable_probabilities(hypotheses: int) -> tuple[float, ...]:
    """Return thresholds on the largest probability of M modes, which is never below 1 / M."""
    low = (0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.5, 0.55, 0.6)
    high = (0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 0.98, 0.99, 0.999)
    return tuple(p for p in (*low, *high) if p == 0.0 or p > 1.0 / hypotheses)


def state_modes(
    log_probability: FloatArray, stated: Actions, started: BoolArray, threshold: float
) -> Actions:
    """Return the next statements of N tracks, (N,), see `ThresholdDecider`.

    Args:
        log_probability: (N, M) logarithms of the probabilities of the modes.
        stated: (N,) last statements.
        started: (N,) False where none has been made; it is then the most probable mode.
        threshold: smallest probability to which the statement changes.
    """
    level = math.log(threshold) if threshold > 0.0 else -math.inf
    changes = log_probability.max(-1) >= level
    return np.where(changes | ~started, log_probability.argmax(-1), stated)


class ThresholdDecider(Decider):
    """Changes its statement to the most probable mode when that is probable enough.

    Until then the last statement is kept.

    Args:
        threshold: smallest probability of a mode to which the statement changes, 0 to 1.
    """

    name = "threshold"
    task = UNKNOWN
    title = "IMM threshold"
    symbol = "probability"
    default = 0.6
    bounds = 0.0, 1.0

    @classmethod
    def create(cls, options: Any, **arguments: Any) -> Self:
        """See `Decider.create`."""
        thresholds = reachable_probabilities(options.hypotheses)
        return super().create(options, **arguments).changed(thresholds=thresholds)

    def act(self, rows: Observations) -> Actions:
        """See `Decider.act`; rows of `hybrid_env.HybridTrackQuickestEnv` have the last
        statement.
        """
        log_probability = QuickestLayout.of_rows(rows).read(rows, "log_probability")
        return state_modes(log_probability, *read_statement(rows), self.threshold)

    def statements(self, log_probability: FloatArray) -> IntArray:
        """Return the statements (T, N) at every tick, from log probabilities (T, N, M)."""
        stated = np.zeros(log_probability.shape[:2], int)
        for tick, values in enumerate(log_probability):
            started = np.full(len(values), tick > 0)
            stated[tick] = state_modes(values, stated[tick - 1], started, self.threshold)
        return stated


def read_statement(observation: Observations) -> tuple[Actions, BoolArray]:
    """Return the last stated mode of N tracks, (N,), and whether there has been a statement,
    (N,).
    """
    stated = QuickestLayout.of_rows(observation).read(observation, "stated")
    return stated.argmax(-1), stated.max(-1) > 0.0
