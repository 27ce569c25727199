"""The sweep over thresholds of both tasks, against records of single thresholds."""

import numpy as np
import pytest

from agents.evaluation.announced import AnnouncedTask
from agents.evaluation.registry import find_family
from agents.evaluation.task import sweep
from agents.evaluation.unknown import UnknownTask
from baselines import FixedTimeDecider, ThresholdDecider, measure_statements, record_statements
from baselines.rules.decider import DeciderFamily
from baselines.rules.rollout import evaluate

ANNOUNCED = AnnouncedTask("hybrid_env:HybridTrackPublished-v0", {"scheme": "random 3x20-40"})
UNKNOWN = UnknownTask(
    "hybrid_env:HybridTrackQuickest-v0",
    {"ticks": 120, "durations": "uniform 20-40"},
)


def family(*thresholds, make=ThresholdDecider):
    return DeciderFamily("x", "p", thresholds, thresholds[0], make)


FIXED = family(5.0, 20.0, make=lambda ticks: FixedTimeDecider(int(ticks)))
CASES = [
    (ANNOUNCED, FIXED),
    (UNKNOWN, family(0.6, 0.9)),
]


def test_scores_of_announced_switches_are_those_of_recorded_decisions():
    scores = sweep(ANNOUNCED, FIXED, 20, 3)
    for index, ticks in enumerate((5, 20)):
        found = evaluate(FixedTimeDecider(ticks), ANNOUNCED.env_id, 20, 3, **ANNOUNCED.given)
        np.testing.assert_array_equal(scores.values[..., index], found.figures)
        confusion = scores.extra["confusion"][index]
        assert confusion.sum() == found.correct.size
        assert confusion.trace() == found.correct.sum()


def test_scores_of_unknown_switches_are_those_of_recorded_statements():
    scores = sweep(UNKNOWN, family(0.5, 0.8), 20, 3)
    for index, threshold in enumerate((0.5, 0.8)):
        recorded = record_statements(ThresholdDecider(threshold), 20, 3, **vars(UNKNOWN.options))
        metrics = measure_statements(recorded, UNKNOWN.options.change_cost)
        for metric in UNKNOWN.metrics:
            found = scores.estimate(metric.statistic, index)
            assert found.value == pytest.approx(metrics.value(metric.name))
            assert found.low <= found.value <= found.high
        quantiles = np.quantile(metrics.delays, [0.5, 0.9])
        np.testing.assert_array_equal(scores.extra["delay_quantiles"][index], quantiles)


def test_a_beam_computes_its_thresholds_at_once_with_the_same_statements():
    beam = find_family("beam", UNKNOWN.options)
    together = sweep(UNKNOWN, beam, 9, 2, thresholds=(0.0, 0.6, 0.9))
    for index, threshold in enumerate(together.thresholds):
        apart = sweep(UNKNOWN, beam, 9, 2, thresholds=(threshold,))
        np.testing.assert_array_equal(together.values[..., index], apart.values[..., 0])


@pytest.mark.parametrize(("task", "deciders"), CASES)
def test_batches_do_not_change_scores(task, deciders, monkeypatch):
    shares = []
    found = []
    for size in (None, 4):
        if size is not None:
            monkeypatch.setattr(type(task), "batch", lambda self: 4)
        found.append(sweep(task, deciders, 10, 3, shares.append))

    np.testing.assert_array_equal(found[0].values, found[1].values)
    for name, array in found[0].extra.items():
        np.testing.assert_array_equal(array, found[1].extra[name])
    assert shares[-1] == max(shares) == 1.0
