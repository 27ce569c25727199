"""Golubkov 2018 and 2020, Tsyganov 2019: published tables, and the detector against its
equations.
"""

import itertools
import math

import numpy as np
import pytest
from matrix_filters import MatrixKalmanFilter

from baselines import SPRTDecider
from baselines.rules.rollout import evaluate
from hybrid_env import simulate
from studies.papers import golubkov2018, golubkov2020, tsyganov2019
from studies.papers.golubkov2020 import detect, log_ratios
from studies.papers.reproduction import study_interval

# Of the quick tests; the table of the documentation has 1000.
RUNS = 400
START = np.array([0.0, 0.0, 0.0, 2.0])


def test_golubkov_2018_tables_are_reproduced():
    result = golubkov2018.reproduce(RUNS, seed=0)
    count = result.count()
    of_ate = [counts[""] for name, counts in count.items() if not name.startswith("Table 2")]
    inside, total = np.sum(of_ate, axis=0)

    assert total == 39
    assert inside >= 36
    for cell in result.cells:
        assert cell.own_low < cell.ours < cell.own_high
    tried = {
        finding.name: finding.value
        for finding in result.findings
        if finding.name.startswith("tried")
    }
    best = [name for name, value in tried.items() if int(value.split()[0]) >= 30]
    assert [name.partition("with ")[2] for name in best] == ["tau = 0.1 s, alpha = beta = 0.001"]
    known_modes = result.tables["Table 2, RMSE with known modes"]
    # R2 is close to the edge of its interval; the bound is 2.7 standard errors of a study of the
    # paper's size.
    for cell in known_modes:
        if cell.column == "nRMSE":
            assert abs(cell.published - cell.ours) < 0.7 * (cell.high - cell.low)
    assert sum(cell.verdict == "inside" for cell in known_modes) >= 10


def test_tsyganov_2019_table_is_reproduced_but_not_its_mode_accuracy():
    result = tsyganov2019.reproduce(RUNS, seed=0)
    ((inside, total),) = (counts[""] for counts in result.count().values())

    assert total == 10
    assert inside >= 9
    claims = [finding for finding in result.findings if finding.claim == tsyganov2019.CLAIM]
    assert len(claims) == 3
    for finding, percentage in zip(claims, (91.1, 89.6, 88.0), strict=True):
        # 9 pieces a run; errors within a run are correlated, with about three times the binomial
        # variance.
        bound = 4 * 100 * math.sqrt(3 * 0.09 / (9 * RUNS))
        assert float(finding.value.split()[0]) == pytest.approx(percentage, abs=bound)


def test_golubkov_2020_delay_is_within_the_distribution():
    result = golubkov2020.reproduce(runs=200, seed=0)
    cells = result.tables["Detection delay of the published realisation, ticks"]

    assert [cell.row for cell in cells if cell.verdict == "inside"][:2] == [
        "alpha = 0.1",
        "alpha = 0.05",
    ]
    assert len(result.tables["Distribution of the delay"]) == 4 * 8


@pytest.mark.study
def test_environment_with_ate_reproduces_table_4_and_the_percentages():
    inside = total = 0
    for row, (name, variance) in enumerate(golubkov2018.MEASUREMENT_VARIANCES.items()):
        decisions = evaluate(
            SPRTDecider(golubkov2018.ALPHA),
            "hybrid_env:HybridTrackPublishedBank-v0",
            episodes=600,
            seed=10_000 * row,
            scheme="golubkov2018",
            heading=math.pi / 2,
            initial_error=0,
            measurement_variance=variance,
            undecided="keep",
        )
        ticks = np.concatenate(
            [decisions.ticks, decisions.ticks.mean(1, keepdims=True)],
            axis=1,
        )
        correct = 100.0 * decisions.type_correct.mean(1, keepdims=True)
        published = (*golubkov2018.TABLE_4[name], golubkov2018.CORRECT_MODES[name])
        _, low, high = study_interval(
            np.concatenate([ticks, correct], axis=1),
            lambda means: means,
            seed=1,
        )
        inside += sum((low <= published) & (published <= high))
        total += len(published)

    assert total == 24
    assert inside >= 21


def test_study_interval_is_that_of_a_mean_of_100_runs():
    values = np.random.default_rng(0).normal(
        5.0,
        2.0,
        (4000, 1),
    )
    mean, low, high = study_interval(
        values,
        lambda means: means,
        seed=0,
    )

    assert mean[0] == pytest.approx(values.mean())
    # With 2,000 resamples the standard error of a 2.5 % quantile is about 4 % of the half width.
    assert high[0] - low[0] == pytest.approx(2 * 1.96 * 0.2, rel=0.1)


@pytest.mark.parametrize("published", [False, True])
def test_the_mean_ratio_equals_equations_6_and_7(published):
    recording = simulate("S6 R8r5", runs=2, seed=1)
    found = log_ratios(recording.measurements, published_root=published)
    matrices = 0.1, 0.001, 0.1 * np.eye(2)
    for run in range(2):
        nominal = MatrixKalmanFilter(
            START,
            np.eye(4),
            "S",
            0.0,
            *matrices,
        )
        # (filter, psi) of every start tick.
        started = {"L": [], "R": []}
        for k, z in enumerate(recording.measurements[run]):
            for side, tests in started.items():
                new = MatrixKalmanFilter(
                    nominal.x,
                    nominal.P,
                    side,
                    5.0,
                    *matrices,
                )
                tests.append([new, 1.0])
            nominal.step(z)
            reference = squared_innovation(nominal)
            for mode, tests in enumerate(started.values(), start=1):
                for test in tests:
                    turn = test[0]
                    turn.step(z)
                    ratio = np.linalg.det(nominal.Sigma) / np.linalg.det(turn.Sigma)
                    root = 1.0 / math.sqrt(ratio) if published else math.sqrt(ratio)
                    test[1] *= root * math.exp((reference - squared_innovation(turn)) / 2)
                average = sum(psi for _, psi in tests) / (k + 1)
                assert found[run, k, mode] == pytest.approx(math.log(average), abs=1e-10)


def squared_innovation(kalman):
    return kalman.innovation @ np.linalg.solve(kalman.Sigma, kalman.innovation)


@pytest.mark.study
def test_statistics_agree_with_an_independent_implementation_at_four_alpha():
    # 2,000 runs in both studies; bounds of 4 standard errors of their difference.
    runs = 2000
    recording = simulate("golubkov2020", runs, seed=12)
    no_switch = simulate("S40", runs, seed=13)
    expected = {
        0.1: (1.05, 14.1, (8, 12, 14, 17, 19), 5.9, 5.1),
        0.05: (0.10, 15.1, (10, 13, 15, 17, 20), 8.7, 2.0),
        0.01: (0.0, 16.5, (12, 15, 17, 18, 20), 19.0, 0.35),
        0.001: (0.0, 17.6, (14, 16, 18, 19, 20), 37.0, 0.04),
    }
    ratios = log_ratios(recording.measurements)
    without_switch = log_ratios(no_switch.measurements)
    for alpha, (alarms, delay, percentiles, missed, alarms_without_switch) in expected.items():
        ticks = detect(ratios, alpha).ticks
        figures = golubkov2020.delay_statistics(ticks)

        def bound(percent):
            probability = max(percent / 100, 1 / runs)
            return 400 * math.sqrt(2 * probability * (1 - probability) / runs)

        assert figures["false alarms by tick 20, %"] == pytest.approx(alarms, abs=bound(alarms))
        assert figures["missed by tick 40, %"] == pytest.approx(missed, abs=bound(missed))
        spread = (ticks[ticks > 20] - 20).std()
        assert figures[golubkov2020.MEAN_DELAY] == pytest.approx(
            delay,
            abs=4 * spread * math.sqrt(2 / runs),
        )
        found = [figures[f"{percentile} % quantile"] for percentile in golubkov2020.PERCENTILES]
        # One tick.
        np.testing.assert_allclose(found, percentiles, atol=1)
        alarm = 100 * (detect(without_switch, alpha).ticks > 0).mean()
        assert alarm == pytest.approx(alarms_without_switch, abs=bound(alarms_without_switch))


@pytest.mark.parametrize("carry", [True, False])
def test_the_filter_with_known_modes_equals_matrix_filters(carry):
    recording = simulate("L40r3 S30 R50r6", runs=2, seed=3, measurement_variance=0.3)
    found = golubkov2018.filter_known_modes(recording, 0.3, carry=carry)
    for run in range(2):
        state = START
        P = np.eye(4)
        measurements = iter(enumerate(recording.measurements[run]))
        for length, radius in zip(recording.lengths, recording.signed_radii, strict=True):
            mode = "S" if radius == 0 else "L" if radius > 0 else "R"
            matrices = 0.1, 0.001, 0.3 * np.eye(2)
            kalman = MatrixKalmanFilter(
                state,
                P,
                mode,
                abs(radius),
                *matrices,
            )
            for k, z in itertools.islice(measurements, int(length)):
                kalman.step(z)
                np.testing.assert_allclose(
                    found[run, k],
                    kalman.x,
                    atol=1e-11,
                )
            state = kalman.x
            P = kalman.P if carry else np.eye(4)
