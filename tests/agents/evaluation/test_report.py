"""Tables and operating curves of deciders, from scores with given means."""

import numpy as np
from given_scores import ANNOUNCED, announced_scores, comparison

from agents.evaluation.curves import comparison_figure
from agents.evaluation.report import Result, result_tables
from agents.evaluation.task import task_of

ATE = announced_scores("ATE (SPRT)", [0.5, 0.6, 0.7], [20, 26, 32])
MSPRT = announced_scores("MSPRT", [0.9, 0.98, 0.99], [15, 18, 26])
RESULT = comparison(ANNOUNCED, ATE, MSPRT)


def heads(table):
    return [str(column.header) for column in table.columns]


def test_no_column_stands_twice_and_thresholds_have_one():
    [table] = result_tables(RESULT.entries)

    assert heads(table)[:2] == ["decider", "threshold"]
    assert not any("type" in head for head in heads(table))
    several = task_of("hybrid_env:HybridTrackBank-v0")
    assert "type_accuracy" in {metric.name for metric in several.shown}


def test_confusion_matrices_are_printed_on_request():
    assert len(result_tables([Result(ANNOUNCED, MSPRT)])) == 1
    _, matrix = result_tables([Result(ANNOUNCED, MSPRT)], confusion=True)

    assert heads(matrix)[1:] == ["S", "L r=5 m", "R r=5 m"]


def test_operating_curves_show_where_most_is_earned():
    axes, _ = comparison_figure(ANNOUNCED, RESULT.seed_groups, bound=0.65).axes
    low, high = axes.get_ylim()
    *levels, note = (text.get_text() for text in axes.texts[:3])
    # The best reward is 0.96 - 0.36, that of ATE far below.
    assert 0.4 < low < 0.6 < 0.65 < high < 0.8
    assert "ATE (SPRT)" in note
    assert "MSPRT" not in note
    assert levels == ["MSPRT 0.600", "bound 0.650"]
    left, right = axes.get_xlim()
    assert 15 < left < 18 < right < 26


def test_names_beside_curves_do_not_overlap():
    same = [announced_scores(f"rule {k}", [0.9, 0.98, 0.99], [15, 18, 26]) for k in range(5)]
    axes = comparison(ANNOUNCED, ATE, *same).picture().axes[0]
    heights = [text.xyann[1] for text in axes.texts if text.get_text().startswith("rule")][1:]

    assert len(heights) == 5
    assert all(np.diff(heights) > 0.079)
    assert max(heights) <= 1.0
