"""A threshold with hysteresis on the probabilities of the bank."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from baselines.rules.decider import UNKNOWN, Actions, DeciderFamily, Observations, RowRule
from hybrid_env.checks import BoolArray, FloatArray, IntArray, check_number, reject
from hybrid_env.core.compilation import compiled
from hybrid_env.observation import QuickestLayout
from hybrid_env.rendering.evidence import EvidencePanel, probability_panel


@compiled
def _choose(
    log_probability: FloatArray,
    stated: Actions,
    started: BoolArray,
    threshold: float,
    release: float,
    actions: Actions,
) -> None:
    """Write the next statements; see `ThresholdDecider.choose`. The thresholds are logarithms."""
    for i in range(stated.size):
        values = log_probability[i]
        best = values.argmax()
        changes = values[best] >= threshold and values[stated[i]] <= release
        actions[i] = best if changes or not started[i] else stated[i]


@compiled
def _choose_by_rows(
    observation: Observations,
    modes: int,
    columns: tuple[int, int],
    scale: float,
    threshold: float,
    release: float,
    actions: Actions,
) -> None:
    """Write the next statements from rows. columns: the first of the log probabilities, of the
    statement.
    """
    tracks = observation.shape[0]
    log_probability = np.empty((tracks, modes))
    stated = np.zeros(tracks, np.int64)
    started = np.zeros(tracks, np.bool_)
    for i in range(tracks):
        for h in range(modes):
            log_probability[i, h] = observation[i, columns[0] + h] / scale
            if observation[i, columns[1] + h] > 0.0:
                stated[i], started[i] = h, True
    _choose(log_probability, stated, started, threshold, release, actions)


PROBABILITIES = (
    *(0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95),
    *(0.98, 0.99, 0.999),
)
"""Thresholds of the probability to sweep."""


def reachable_probabilities(hypotheses: int) -> tuple[float, ...]:
    """Return thresholds on the largest probability of M modes, which is never below 1 / M."""
    return tuple(p for p in PROBABILITIES if p == 0.0 or p > 1.0 / hypotheses)


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
    colour = "#6900ff"
    marker = "o"

    def __init__(self, threshold: float = 0.6, release: float = 1.0):
        self.threshold = _check_probability("threshold", threshold)
        self.release = _check_probability("release", release)
        self._log_threshold, self._log_release = _log(self.threshold), _log(self.release)

    @classmethod
    def family(cls, options: Any) -> DeciderFamily:
        """See `Decider.family`."""
        thresholds = reachable_probabilities(options.hypotheses)
        return replace(super().family(options), thresholds=thresholds)

    def act(self, rows: Observations) -> Actions:
        """See `RowRule.act`; rows of `hybrid_env.HybridTrackQuickestEnv` have the last
        statement.
        """
        rows = np.ascontiguousarray(rows, np.float32)
        layout = QuickestLayout.of_rows(rows)
        actions = np.empty(len(rows), np.int64)
        columns = layout.slices["log_probability"].start, layout.slices["stated"].start
        scale = layout.scales["log_probability"]
        _choose_by_rows(
            rows,
            layout.hypotheses,
            columns,
            scale,
            self._log_threshold,
            self._log_release,
            actions,
        )
        return actions

    def panel(self) -> EvidencePanel:
        """Return the panel of `evidence`."""
        return probability_panel("bank", self.threshold)

    def choose(self, log_probability: FloatArray, stated: Actions, started: BoolArray) -> Actions:
        """Return the next statements of N tracks, (N,), from log probabilities of the modes, (N,
        M), and the last ones, (N,).

        Where none has `started`, it is the most probable mode.
        """
        actions = np.empty(len(stated), np.int64)
        _choose(log_probability, stated, started, self._log_threshold, self._log_release, actions)
        return actions

    def statements(self, log_probability: FloatArray) -> IntArray:
        """Return the statements (T, N) at every tick, from log probabilities (T, N, M)."""
        stated = np.zeros(log_probability.shape[:2], np.int64)
        for tick, values in enumerate(log_probability):
            stated[tick] = self.choose(values, stated[tick - 1], np.full(len(values), tick > 0))
        return stated


def read_statement(observation: Observations) -> tuple[Actions, BoolArray]:
    """Return the last stated mode of N tracks, (N,), and whether there has been a statement,
    (N,).
    """
    stated = QuickestLayout.of_rows(observation).read(observation, "stated")
    return stated.argmax(-1), stated.max(-1) > 0.0


def _check_probability(name: str, value: Any) -> float:
    allowed = "a number from 0 to 1"
    number = check_number(name, value, allowed)
    if not 0.0 <= number <= 1.0:
        raise reject(name, value, allowed)
    return number


def _log(probability: float) -> float:
    return math.log(probability) if probability > 0.0 else -math.inf
