"""Table of `hybridtrack evaluate --shifted`."""

import io

import numpy as np
from rich.console import Console

from agents.evaluation.shifted_worlds import NOMINAL, ShiftResult, shift_table

DECIDERS = (
    "shipped", "ATE (SPRT)", "MSPRT", "MSPRT, kept covariance", "calibrated anchor",
    "calibrated anchor, robust filters",
)  # fmt: skip


def result(world: str, decider: str, reward: float) -> ShiftResult:
    episodes = np.full(10, reward)
    low, high = reward - 0.012, reward + 0.012
    bounds = (reward, low, high)
    return ShiftResult(world, decider, 0.1, *bounds, 0.9, 20.0, 0.2, *bounds, episodes, episodes - 0.01)


def test_six_deciders_fit_into_80_columns() -> None:
    worlds = (NOMINAL, "first estimate 3 times as wrong")
    results = [result(w, name, 0.5 + k / 16) for k, name in enumerate(DECIDERS) for w in worlds]
    printed = io.StringIO()
    Console(file=printed, width=80).print(shift_table(results, "Title"))
    text = printed.getvalue()
    assert "…" not in text
    row = next(line for line in text.splitlines() if line.startswith("nominal"))
    assert row.split()[1:] == ["+0.500", "+0.562", "+0.625", "+0.688", "+0.750", "+0.812", "-0.312"]
    assert text.count("±0.012") == 2 * len(DECIDERS)
