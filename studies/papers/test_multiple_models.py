"""ATE against multiple models: figures of a run, and the tables of a study."""

import numpy as np
import pytest

from hybrid_env import Simulation
from studies.papers import multiple_models
from studies.papers.multiple_models import SETTINGS, Tracked, score


def test_figures_of_two_runs_are_those_counted_by_hand():
    truth = np.zeros((2, 6, 4))
    recording = Simulation(
        truth,
        truth[..., :2],
        np.array([4, 2]),
        np.array([0.0, -5.0]),
    )
    sides = np.array([[0, 1, 0, 0, 0, -1], [0, 0, 0, 1, 1, 0]])
    scores = score(
        "name",
        recording,
        Tracked(
            truth + np.array([1.0, 2.0, 0.0, 0.0]),
            sides,
            np.array([3.0, 5.0]),
        ),
    )
    by_run = {name: scores.of(name, 0).tolist() for name in scores.columns}

    assert by_run == {
        "squares": [5.0, 5.0],
        # Ticks until the statement is right for good.
        "delay": [(2 + 1) / 2, (4 + 2) / 2],
        "wrong": [0.0, 100.0],
        "wrong_changes": [1000.0 / 6.0, 2000.0 / 6.0],
        "steps": [3.0, 5.0],
    }


def test_small_study_has_a_table_of_every_setting(monkeypatch):
    monkeypatch.setattr(multiple_models, "SETTINGS", SETTINGS[:1])
    monkeypatch.setattr(multiple_models, "VARIANCES", (0.1,))
    monkeypatch.setattr(
        multiple_models,
        "MULTIPLE_MODELS",
        {
            "static": "static",
            "IMM": "imm",
            "GPB1": "gpb1",
        },
    )
    result = multiple_models.reproduce(runs=3, seed=1)
    names = {
        name: list(dict.fromkeys(cell.row for cell in cells))
        for name, cells in result.tables.items()
    }
    known, unknown = (
        f"Golubkov 2018, {moments} moments, R = 0.1" for moments in ("known", "unknown")
    )

    assert names == {
        known: ["ATE", "ATE, radius refined", "IMM", "GPB1"],
        f"{known}, paired differences": [
            "ATE, radius refined less ATE",
            "IMM less ATE",
            "GPB1 less ATE",
            "IMM less ATE, radius refined",
            "GPB1 less IMM",
        ],
        unknown: ["detector 2020", "static", "IMM", "GPB1"],
        f"{unknown}, paired differences": [
            "static less detector 2020",
            "IMM less detector 2020",
            "GPB1 less detector 2020",
            "IMM less static",
            "GPB1 less IMM",
        ],
    }
    values = {(cell.table, cell.row, cell.column): cell.ours for cell in result.cells}
    for column in ("nRMSE", "delay, ticks", "wrong, %"):
        assert values[f"{known}, paired differences", "IMM less ATE", column] == pytest.approx(
            values[known, "IMM", column] - values[known, "ATE", column]
        )
    assert values[known, "IMM", "nRMSE"] < 0.6 < values[known, "ATE", "nRMSE"]
    assert values[unknown, "IMM", "Kalman steps a tick"] == pytest.approx(21.0)
    assert "IMM < ATE" in result.findings[0].value
