"""The sweep over thresholds of both tasks, against records of single thresholds."""

import numpy as np
import pytest

from agents.evaluation.registry import find_decider
from agents.evaluation.task import sweep, task_of
from baselines import FixedTimeDecider, ThresholdDecider, measure_statements, record_statements
from baselines.rules.rollout import record_decisions

ANNOUNCED = task_of("hybrid_env:HybridTrackPublished-v0", {"scheme": "random 3x20-40"})
UNKNOWN = task_of("hybrid_env:HybridTrackQuickest-v0", {"ticks": 120, "durations": "uniform 20-40"})


FIXED = FixedTimeDecider().changed(thresholds=(5.0, 20.0))
CASES = [(ANNOUNCED, FIXED), (UNKNOWN, ThresholdDecider().changed(thresholds=(0.6, 0.9)))]


def test_scores_of_announced_switches_are_those_of_recorded_decisions():
    scores = sweep(ANNOUNCED, FIXED, 20, 3)
    for index, ticks in enumerate((5, 20)):
        decisions = record_decisions(
            FixedTimeDecider(ticks), ANNOUNCED.env_id, 20, 3, **ANNOUNCED.given
        )
        np.testing.assert_array_equal(scores.values[..., index], decisions.values)
        accuracy = scores.estimate(ANNOUNCED.statistic("accuracy"), index).value
        assert accuracy == pytest.approx(decisions.correct.mean())
        # Over ticks, not over segments.
        error = np.sqrt(decisions.squared_error.sum() / decisions.length.sum())
        rmse = scores.estimate(ANNOUNCED.statistic("rmse"), index).value
        assert rmse == pytest.approx(error)


def test_scores_of_unknown_switches_are_those_of_recorded_statements():
    scores = sweep(UNKNOWN, ThresholdDecider().changed(thresholds=(0.5, 0.8)), 20, 3)
    for index, threshold in enumerate((0.5, 0.8)):
        recorded = record_statements(ThresholdDecider(threshold), 20, 3, **vars(UNKNOWN.options))
        metrics = measure_statements(recorded, UNKNOWN.options.change_cost)
        for metric in UNKNOWN.shown:
            estimate = scores.estimate(metric.statistic, index)
            assert estimate.value == pytest.approx(metrics.value(metric.name))
            assert estimate.low <= estimate.value <= estimate.high
        quantiles = np.quantile(metrics.delays, [0.5, 0.9])
        np.testing.assert_array_equal(scores.extra["delay_quantiles"][index], quantiles)


def test_a_beam_computes_its_thresholds_at_once_with_the_same_statements():
    beam = find_decider("beam", UNKNOWN.options)
    at_once = sweep(UNKNOWN, beam, 4, 2, thresholds=(0.0, 0.6))
    for index, threshold in enumerate(at_once.thresholds):
        apart = sweep(UNKNOWN, beam, 4, 2, thresholds=(threshold,))
        np.testing.assert_array_equal(at_once.values[..., index], apart.values[..., 0])


@pytest.mark.parametrize(("task", "deciders"), CASES)
def test_batches_do_not_change_scores(task, deciders, monkeypatch):
    whole = sweep(task, deciders, 10, 3)
    monkeypatch.setattr(type(task), "batch", lambda self: 4)
    batched = sweep(task, deciders, 10, 3)

    np.testing.assert_array_equal(batched.values, whole.values)
    for name, array in whole.extra.items():
        np.testing.assert_array_equal(batched.extra[name], array)
