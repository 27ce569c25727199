"""Tables and figure of the attainable decision times, from given results."""

import itertools
import math

import numpy as np
import pytest
from agents.evaluation.operating_curve import Estimate
from agents.limits import steps
from agents.limits.figures import decision_times
from agents.limits.report import calibration_markdown, rules_markdown, type_accuracy_markdown
from agents.limits.steps import STEPS, step_calls, steps_markdown, with_gains
from agents.limits.study import (
    BANK_ENV,
    BANKS,
    NOISE_LEVELS,
    THREE_MODE_ENV,
    BankCalibration,
    RuleResult,
    TypeAccuracy,
    type_accuracy_calls,
)

from agents.figures.decider_colours import STYLES
from agents.interface.parallel import Workers
from baselines.rules.posterior_paths import CalibrationSummary

NOT_REACHED = Estimate(math.inf, math.inf, math.inf)
RULES = ("ATE (SPRT)", "MSPRT", "Bayes risk")


def around(value):
    return Estimate(value, value - 0.5, value + 0.5)


@pytest.fixture(scope="module")
def results():
    """MSPRT and Bayes risk coincide; ATE never reaches 98 % on the first bank."""
    found = []
    for bank, noise, rule in itertools.product(BANKS, NOISE_LEVELS, RULES):
        time = around(20.0 + 10.0 * math.log10(noise / 0.01) - (0.0 if rule == RULES[0] else 3.0))
        if rule == RULES[0] and bank == BANKS[0]:
            time = NOT_REACHED
        found.append(RuleResult(THREE_MODE_ENV, noise, bank, rule, time, time, around(0.5), 0.1))
    return found


def test_tables_have_a_row_for_each_bank_and_rule(results):
    text = rules_markdown(results)
    assert "| R = 0.01 | R = 0.1 | R = 1 |" in text
    rows = [line for line in text.splitlines() if line.startswith("| ") and "bank" not in line]
    assert len(rows) == len(BANKS) * len(RULES)
    assert rows[0].startswith("| published | ATE (SPRT) | not reached / not reached; 0.500 [0.000, 1.000] |")
    assert rows[1].startswith("| published | MSPRT | 17.0 [16.5, 17.5] / 17.0 [16.5, 17.5]; 0.500")


def test_calibration_and_type_accuracy_are_in_percent():
    calibration = [BankCalibration("oracle", 0.1, 5, CalibrationSummary(0.5, 0.52, -0.031))]
    assert "| oracle | 0.1 | 50.0 / 52.0 (-3.1) |" in calibration_markdown(calibration)
    accuracy = [TypeAccuracy("anchor_aware", 1.0, Estimate(0.98, 0.97, 0.99), 45.52)]
    assert "| anchor-aware | 1 | 98.0 [97.0, 99.0] | 45.5 |" in type_accuracy_markdown(accuracy)


def test_every_rule_is_labelled_in_its_colour_and_missing_times_are_marked(results):
    figure = decision_times(results)
    assert len(figure.axes) == len(BANKS)
    for axes, bank in zip(figure.axes, BANKS, strict=True):
        assert {text.get_text() for text in axes.texts} == set(RULES)
        hollow = [line for line in axes.lines if line.get_markerfacecolor() == "white"]
        assert len(hollow) == (len(NOISE_LEVELS) if bank == BANKS[0] else 0)
        assert {line.get_color() for line in hollow} <= {STYLES["ATE (SPRT)"].colour}
        shown = {line.get_color() for line in axes.lines if np.isfinite(line.get_ydata()).all()}
        assert {STYLES["MSPRT"].colour, STYLES["Bayes risk"].colour} <= shown
    assert "not reached" in [label.get_text() for label in figure.axes[0].get_yticklabels()]


def test_the_gap_rule_reaches_a_high_type_accuracy_on_the_scheme_of_2018(monkeypatch):
    monkeypatch.setattr("agents.limits.study.BANKS", BANKS[:1])
    found = [one for _, one in Workers().results(type_accuracy_calls(20, 0))]
    assert [one.noise for one in found] == list(NOISE_LEVELS)
    assert all(one.accuracy.value > 0.9 for one in found)
    assert found[0].ticks < found[1].ticks < found[2].ticks


def test_each_step_has_a_paired_gain(monkeypatch):
    monkeypatch.setattr(steps, "NOISE_LEVELS", (0.1,))
    calls = step_calls(THREE_MODE_ENV, 10, 0) | step_calls(BANK_ENV, 10, 0)
    found = with_gains(one for _, one in Workers().results(calls))
    assert len(found) == 2 * len(STEPS)
    assert [one.step for one in found if one.gain is None] == 2 * list(STEPS)[:1]
    for before, one in itertools.pairwise(found[: len(STEPS)]):
        assert one.gain.value == pytest.approx(one.reward.value - before.reward.value)
        assert one.gain.low <= one.gain.value <= one.gain.high
    rows = [line for line in steps_markdown(found).splitlines() if line.startswith("| ")]
    assert len(rows) == 2 * (1 + len(STEPS))
    assert all(line.count("|") == rows[0].count("|") for line in rows)
