"""The SPRT: thresholds, the rule for several hypotheses, and Wald's bounds."""

import math

import numpy as np
import pytest

from baselines import SPRTDecider, sprt_thresholds
from baselines.rules.rollout import record_decisions
from baselines.rules.sprt import sprt_test

A, B = sprt_thresholds(0.01, 0.02)


def test_thresholds_are_those_of_wald():
    assert pytest.approx(math.log(0.98 / 0.01)) == A
    assert pytest.approx(math.log(0.02 / 0.99)) == B


def decide(ratios, reference=0, running=None):
    running = np.ones(len(ratios), bool) if running is None else running
    return sprt_test(np.array(ratios, float), running, reference, A, B), running.tolist()


@pytest.mark.parametrize(
    ("ratios", "reference", "winner"),
    [
        # The largest of several above the threshold.
        ([0.0, A + 1.0, A + 2.0, A + 1.5], 0, 2),
        ([0.0, B - 0.1, 0.5], 0, -1),
        # All others are rejected.
        ([B - 1.0, B - 2.0, 0.0], 2, 2),
        # Ratios are to the reference, not to the most likely hypothesis.
        ([5.0, 9.0, 0.0], 1, 1),
        ([5.0, 5.0 + A - 0.01, 5.0], 0, -1),
    ],
)
def test_ratios_to_the_reference_are_compared_with_both_thresholds(ratios, reference, winner):
    assert decide(ratios, reference)[0] == winner


def test_rejected_hypotheses_stay_rejected():
    _, running = decide([0.0, B - 0.1, 0.5])
    assert running == [True, False, True]
    assert decide([0.0, A + 5.0, 0.5], running=np.array(running))[0] == -1


def test_error_rate_and_decision_time_of_two_normal_hypotheses_satisfy_walds_bounds():
    # N(d, 1) against N(0, 1), d = .5, where the reference N(0, 1) is true: the error rate is at
    # most alpha / (1 - beta), and the mean time at least ((1 - a) B + a A) / E[increment], where a
    # is the realized error rate; bounds of 4 standard errors.
    generator = np.random.default_rng(1)
    shift = 0.5
    runs = 4000
    errors = 0
    times = []
    for _ in range(runs):
        ratio = np.zeros(2)
        running = np.ones(2, bool)
        winner = -1
        k = 0
        while winner < 0:
            ratio[1] += shift * generator.standard_normal() - shift * shift / 2
            winner = sprt_test(ratio, running, 0, A, B)
            k += 1
        errors += winner
        times.append(k)
    rate = errors / runs
    bound = 0.01 / 0.98

    assert rate <= bound + 4 * math.sqrt(bound / runs)
    expected = ((1 - rate) * B + rate * A) / (-shift * shift / 2)
    assert np.mean(times) >= expected - 4 * np.std(times) / math.sqrt(runs)
    # Overshoot of one increment, relative to a threshold of about 4.
    assert np.mean(times) <= 1.25 * expected


@pytest.mark.parametrize(("alpha", "accuracy", "ticks"), [(0.1, 0.846, 20.4), (1e-6, 0.986, 31.5)])
def test_ate_has_the_accuracy_and_decision_time_of_an_independent_implementation(
    alpha, accuracy, ticks
):
    # 9,000 segments: standard errors of at most .004 and .1 tick; tolerances .012 and .6.
    decisions = record_decisions(
        SPRTDecider(alpha), "hybrid_env:HybridTrackPublished-v0", episodes=1500, seed=123
    )
    assert decisions.correct.mean() == pytest.approx(accuracy, abs=0.012)
    assert decisions.ticks.mean() == pytest.approx(ticks, abs=0.6)
