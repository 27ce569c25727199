"""Figures, tables and JSON of a comparison, from scores with given means."""

import json

import numpy as np
import pytest
from given_scores import ANNOUNCED, UNKNOWN, announced_scores, comparison, unknown_scores
from rich.console import Console

from agents.commands.comparison import score
from agents.commands.continuation import Plan
from agents.commands.tables import chosen_table, levels_table, spread_lines

ATE = announced_scores(
    "ATE (SPRT)",
    [0.7, 0.9, 0.96, 0.985],
    [15, 20, 26, 32],
)
PPO = announced_scores(
    "ppo",
    [0.6, 0.95, 0.99, 1.0],
    [5, 12, 16, 30],
)
IMM = unknown_scores(
    "IMM threshold",
    [16.0, 8.0, 4.0, 1.0],
    [12, 14, 16, 20],
    [0.7, 0.75, 0.76, 0.74],
)
BEAM = unknown_scores(
    "beam",
    [15.0, 7.0, 3.0, 0.7],
    [11.0, 13.0, 15.0, 19.0],
    [0.71, 0.76, 0.78, 0.75],
)
CUSUM = unknown_scores(
    "CUSUM",
    [40.0, 20.0, 6.0, 3.0],
    [13.0, 15.0, 19.0, 30.0],
    [0.5, 0.6, 0.7, 0.68],
)
RESULTS = {
    "announced": comparison(ANNOUNCED, ATE, PPO, agents=1),
    "unknown": comparison(UNKNOWN, IMM, BEAM, CUSUM),
}


def text_of(table, width=100):
    console = Console(width=width)
    with console.capture() as captured:
        console.print(table)
    return captured.get()


def test_training_seeds_are_one_curve():
    seeds = [
        announced_scores(
            f"ppo seed {k}",
            [0.6, 0.95, 0.99, 1.0],
            np.array([5, 12, 16, 30]) + k,
        )
        for k in range(3)
    ]
    result = comparison(ANNOUNCED, ATE, *seeds, agents=3)

    assert {key: len(group) for key, group in result.seed_groups.items()} == {ATE.name: 1, "ppo": 3}
    assert [line.partition(",")[0] for line in spread_lines(result)] == [
        "ppo over 3 training seeds"
    ]


def test_the_largest_difference_is_that_of_the_best_agent_or_rule():
    best, episode = RESULTS["announced"].largest_difference()
    assert (best.name, episode) == ("ppo", 0)
    assert RESULTS["unknown"].largest_difference()[0].name == "beam"
    worse = comparison(
        UNKNOWN,
        BEAM,
        unknown_scores("agent", [8.0], [14.0], [0.7]),
        agents=1,
    )
    assert worse.largest_difference()[0].name == "agent"
    assert worse.best_rule.name == "beam"


def test_differences_are_to_the_best_rule_and_ratios_to_the_first():
    result = RESULTS["unknown"]
    first, beam, cusum = result.entries

    assert result.best_rule is beam
    assert result.to_best_rule(beam) is None
    assert result.to_best_rule(first).value == pytest.approx(0.76 - 0.78)
    # 16 + 2 / 3 of 4 at 2 changes of the reference; 15 + 1 / 2.3 of 4 of the beam.
    ratio = result.against(beam)["full_delay"]
    assert ratio.value == pytest.approx((15.0 + 4.0 / 2.3) / (16.0 + 8.0 / 3.0))
    assert np.isinf(result.against(cusum)["full_delay"].value)
    assert f"{ratio.value:.3f}" in text_of(levels_table(result))
    assert "diff.: reward less that of beam" in text_of(chosen_table(result))


def test_the_error_at_the_time_of_the_reference_is_interpolated():
    result = comparison(ANNOUNCED, ATE, PPO, agents=1)
    (at_time, *times) = result.levels
    reference, ppo = (result.at_levels(entry)[at_time].value for entry in result.entries)
    # At 20 ticks.
    assert (reference, ppo) == pytest.approx((0.1, 0.01 * 10 / 14))
    assert result.at_levels(result.entries[1])[times[0]].value == pytest.approx(12.0)
    paired = result.against(result.entries[1])
    assert paired["ticks_at_98"].value == pytest.approx((12 + 4 * 0.75) - (26 + 6 * 0.8))


@pytest.mark.parametrize("result", RESULTS.values(), ids=RESULTS)
def test_json_has_every_figure_and_null_where_one_is_undefined(result):
    data = json.loads(json.dumps(result.as_json(), allow_nan=False))
    assert data["best_rule"] == result.best_rule.name
    for entry, row in zip(result.entries, data["deciders"], strict=True):
        assert row["name"] == entry.name
        assert row["curve"]["thresholds"] == list(entry.scores.thresholds)
        for metric in result.plan.task.metrics:
            value = row["curve"][metric.name][entry.chosen]
            assert row[metric.name]["value"] == (None if value is None else pytest.approx(value))
        assert (row["reward_less_best_rule"] is None) == (entry is result.best_rule)
    if result is RESULTS["unknown"]:
        first, _, last = (row["at_equal_wrong_changes"]["full_delay"] for row in data["deciders"])
        assert first["value"] == pytest.approx(16.0 + 8.0 / 3.0)
        assert last == {
            "value": None,
            "low": None,
            "high": None,
        }


RULE = "def rule(rows):\n    return rows[:, 0].astype(int) * 0 + {}\n"
TITLED = RULE + "rule.title = 'ATE (SPRT)'\n"


@pytest.fixture
def sources(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder, source in (
        ("a", RULE),
        ("b", RULE),
        ("c", TITLED),
    ):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.py").write_text(source.format(1))


@pytest.mark.parametrize(
    ("names", "titles"),
    [
        (["ate", "a/mine.py:rule"], ["ATE (SPRT)", "rule"]),
        (
            ["ate", "a/mine.py:rule", "b/mine.py:rule"],
            ["ATE (SPRT)", "a/mine.py:rule", "b/mine.py:rule"],
        ),
        (["ate", "c/mine.py:rule"], ["ATE (SPRT)", "c/mine.py:rule"]),
    ],
)
def test_equal_titles_are_told_apart_by_their_paths(sources, names, titles):
    plan = Plan(ANNOUNCED, tuple(names), (), 2, 0, 2)
    assert [*plan.titles.values()] == titles
    assert "titles" not in plan.settings
    last = names[-1]
    if last.endswith("rule"):
        assert score(plan, None, last, 0, True, None).name == titles[-1]
