"""The figures and tables of deciders for unknown switch moments, from curves with given means."""

import io
import json

import numpy as np
import pytest
from agents.comparison.figures import tradeoff
from agents.comparison.statement_report import chosen_table, equal_table
from agents.comparison.statement_study import (
    EQUAL_STATISTICS,
    StatementComparison,
    StatementEntry,
    StatementPlan,
)
from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.statement_curve import (
    DELAY,
    DETECTED,
    REWARD,
    ROWS,
    SWITCHES,
    UNDETECTED,
    WRONG_CHANGES,
    StatementCurve,
    TrackMetrics,
)
from agents.evaluation.statement_table import statement_figures
from rich.console import Console

from agents.figures.decider_colours import STATEMENT_STYLES
from baselines import ThresholdDecider
from hybrid_env.quickest_options import QuickestOptions

OPTIONS = QuickestOptions(ticks=150, durations="uniform 20-40")
REFERENCE = ("IMM threshold", [16.0, 8.0, 4.0, 1.0], [12.0, 14.0, 16.0, 20.0], [0.7, 0.75, 0.76, 0.74])
BETTER = ("beam", [15.0, 7.0, 3.0, 0.7], [11.0, 13.0, 15.0, 19.0], [0.71, 0.76, 0.78, 0.75])
NEVER_FEW = ("CUSUM", [40.0, 20.0, 6.0, 3.0], [13.0, 15.0, 19.0, 30.0], [0.5, 0.6, 0.7, 0.68])


def entry(name, rates, delays, rewards, tracks=6):
    metrics = []
    for rate, delay, reward in zip(rates, delays, rewards, strict=True):
        rows = np.zeros((tracks, len(ROWS)))
        rows[:, WRONG_CHANGES], rows[:, REWARD] = rate, reward
        rows[:, SWITCHES] = rows[:, DETECTED] = 8.0
        rows[:, DELAY] = rows[:, UNDETECTED] = 8.0 * delay
        rows[0, REWARD] -= 0.1 * (name == "beam")
        metrics.append(TrackMetrics(rows, np.full(8 * tracks, round(delay))))
    family = DeciderFamily(name, "p", (0.4, 0.5, 0.6, 0.8), 0.4, ThresholdDecider)
    curve = StatementCurve(family, tuple(metrics))
    equal = {key: curve.estimate(statistic) for key, statistic in EQUAL_STATISTICS.items()}
    chosen = int(np.argmax(rewards))
    return StatementEntry(curve, chosen, max(rewards), statement_figures(curve.at(chosen)), equal)


def comparison(*entries, agents=0):
    names = tuple(one.name for one in entries)
    rules = len(names) - agents
    plan = StatementPlan("hybrid_env:HybridTrackQuickest-v0", {}, names[:rules], names[rules:], 6, 0, 6)
    return StatementComparison(plan, OPTIONS, entries)


def text_of(table):
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(table)
    return console.export_text()


def test_both_panels_show_every_decider_with_its_selected_threshold():
    names = {"IMM threshold", "beam", "CUSUM"}
    for axes in tradeoff(comparison(entry(*REFERENCE), entry(*BETTER), entry(*NEVER_FEW))).axes:
        assert {text.get_text() for text in axes.texts if text.get_text()} == names
        box = axes.get_window_extent()
        filled = [line for line in axes.lines if line.get_markersize() == 8]
        assert {line.get_color() for line in filled} == {STATEMENT_STYLES[name].colour for name in names}
        for line in filled:
            assert all(box.contains(*point) for point in axes.transData.transform(line.get_xydata()))


def test_a_decider_without_wrong_changes_has_no_point_on_the_logarithmic_axis():
    silent = entry("CUSUM", [0.0] * 4, [40.0] * 4, [0.4] * 4)
    left, _ = tradeoff(comparison(entry(*REFERENCE), silent)).axes
    assert not any(line.get_color() == STATEMENT_STYLES["CUSUM"].colour for line in left.lines)


def test_differences_are_to_the_best_rule_and_ratios_to_the_first():
    result = comparison(entry(*REFERENCE), entry(*BETTER), entry(*NEVER_FEW))
    assert result.best_rule.name == result.best.name == "beam"
    assert result.differences[1] is None
    assert result.differences[0].value == pytest.approx(0.76 - (0.78 - 0.1 / 6))
    # 16 + 2 / 3 of 4 at 2 changes of the reference; 15 + 1 / 2.3 of 4 of the beam
    ratio = result.ratios[1]["full_delay"]
    assert ratio.value == pytest.approx((15.0 + 4.0 / 2.3) / (16.0 + 8.0 / 3.0))
    assert result.ratios[0]["full_delay"].value == 1.0
    assert np.isinf(result.ratios[2]["full_delay"].value)
    assert result.largest_difference() == 0
    text = text_of(equal_table(result))
    assert f"{ratio.value:.3f}" in text
    assert "reached" in text
    assert "diff.: reward of a tick less that of beam" in text_of(chosen_table(result))


def test_the_best_agent_is_drawn_even_if_a_rule_is_better():
    result = comparison(entry(*BETTER), entry("agent", *REFERENCE[1:]), agents=1)
    assert result.best.name == "agent"
    assert result.best_rule.name == "beam"


def test_undefined_figures_are_null_in_json():
    result = comparison(entry(*REFERENCE), entry(*NEVER_FEW))
    data = json.loads(json.dumps(result.as_json(), allow_nan=False))
    first, second = data["deciders"]
    assert first["at_equal_wrong_changes"]["full_delay"]["value"] == pytest.approx(16.0 + 8.0 / 3.0)
    assert second["at_equal_wrong_changes"]["full_delay"] == {"value": None, "low": None, "high": None}
    assert second["curve"]["thresholds"] == [0.4, 0.5, 0.6, 0.8]
    assert second["curve"]["wrong_changes"] == [40.0, 20.0, 6.0, 3.0]
