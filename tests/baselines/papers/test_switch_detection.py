"""The detector of Golubkov 2020 agrees with its equations and with an independent implementation."""

import math

import numpy as np
import pytest
from matrix_filters import MatrixKalmanFilter

from baselines.papers import golubkov2020
from baselines.papers.golubkov2020 import detect_switch
from hybrid_env.checks import ArgumentError
from hybrid_env.simulation import simulate

START = np.array([0.0, 0.0, 0.0, 2.0])


@pytest.mark.parametrize("published", [False, True])
def test_the_mean_ratio_equals_equations_6_and_7(published):
    recording = simulate("S6 R8r5", runs=2, seed=1)
    found = detect_switch(recording.measurements, START, published_root=published)
    R = 0.1 * np.eye(2)
    for run in range(2):
        nominal = MatrixKalmanFilter(START, np.eye(4), "S", 0.0, 0.1, 0.001, R)
        started = {1: [], 2: []}  # (filter, psi) of every start tick
        for k, z in enumerate(recording.measurements[run]):
            for mode, side in ((1, "L"), (2, "R")):
                started[mode].append(
                    [MatrixKalmanFilter(nominal.x, nominal.P, side, 5.0, 0.1, 0.001, R), 1.0]
                )
            nominal.step(z)
            quadratic = nominal.innovation @ np.linalg.solve(nominal.Sigma, nominal.innovation)
            for mode in (1, 2):
                for pair in started[mode]:
                    one = pair[0]
                    one.step(z)
                    root = math.sqrt(np.linalg.det(nominal.Sigma) / np.linalg.det(one.Sigma))
                    own = one.innovation @ np.linalg.solve(one.Sigma, one.innovation)
                    pair[1] *= (1 / root if published else root) * math.exp((quadratic - own) / 2)
                average = sum(psi for _, psi in started[mode]) / (k + 1)
                assert found.log_ratios[run, k, mode] == pytest.approx(math.log(average), abs=1e-10)


def test_statistics_agree_with_an_independent_implementation_at_four_alpha():
    # 2,000 runs in both studies; bounds of 4 standard errors of their difference
    runs = 2000
    recording = simulate("golubkov2020", runs, seed=12)
    no_switch = simulate("S40", runs, seed=13)
    expected = {
        0.1: (1.05, 14.1, (8, 12, 14, 17, 19), 5.9, 5.1),
        0.05: (0.10, 15.1, (10, 13, 15, 17, 20), 8.7, 2.0),
        0.01: (0.0, 16.5, (12, 15, 17, 18, 20), 19.0, 0.35),
        0.001: (0.0, 17.6, (14, 16, 18, 19, 20), 37.0, 0.04),
    }
    for alpha, (alarms, delay, percentiles, missed, alarms_without_switch) in expected.items():
        ticks = golubkov2020.run_detector(recording, alpha).ticks
        figures = golubkov2020.delay_statistics(ticks)

        def bound(percent):
            probability = max(percent / 100, 1 / runs)
            return 400 * math.sqrt(2 * probability * (1 - probability) / runs)

        assert figures["false alarms by tick 20, %"] == pytest.approx(alarms, abs=bound(alarms))
        assert figures["missed by tick 40, %"] == pytest.approx(missed, abs=bound(missed))
        spread = (ticks[ticks > 20] - 20).std()
        assert figures["mean delay"] == pytest.approx(delay, abs=4 * spread * math.sqrt(2 / runs))
        found = [figures[f"{percentile} % quantile"] for percentile in golubkov2020.PERCENTILES]
        np.testing.assert_allclose(found, percentiles, atol=1)  # one tick
        alarm = 100 * (golubkov2020.run_detector(no_switch, alpha).ticks > 0).mean()
        assert alarm == pytest.approx(alarms_without_switch, abs=bound(alarms_without_switch))


def test_large_likelihood_ratios_do_not_overflow():
    recording = simulate("S100 R400r1", runs=1, seed=0, measurement_variance=1e-6, process_variance=1e-9)
    found = detect_switch(
        recording.measurements[0], START, radii=[1.0], measurement_variance=1e-6, process_variance=1e-9
    )
    assert np.isfinite(found.log_ratios[:, 1:]).all()
    assert np.nanmax(found.log_ratios) > 800  # the ratio itself exceeds the largest float64
    assert found.ticks > 100
    assert found.modes == 2


def test_a_margin_delays_the_detection_until_one_hypothesis_exceeds_all_others():
    recording = simulate("S20 L60r4", runs=50, seed=5)
    radii = [3.0, 4.0, 5.0]
    early = detect_switch(recording.measurements, START, radii=radii, alpha=0.01)
    late = detect_switch(recording.measurements, START, radii=radii, alpha=0.01, margin=math.log(9))
    both = (early.ticks > 0) & (late.ticks > 0)
    assert (late.ticks[both] >= early.ticks[both]).all()
    for run in np.flatnonzero(late.ticks):
        ranked = np.sort(late.log_ratios[run, late.ticks[run] - 1, 1:])
        assert ranked[-1] - ranked[-2] >= math.log(9)
    assert (late.modes[both] == 2).mean() > (early.modes[both] == 2).mean()


def test_only_tested_hypotheses_are_declared():
    recording = simulate("S20 L60r5", runs=20, seed=5)
    found = detect_switch(recording.measurements, START, tested=[2], alpha=0.01)
    assert set(found.modes[found.ticks > 0].tolist()) <= {2}


INVALID = [
    ({"measurements": [[0.0, np.nan]] * 4}, "measurements[0, 1]=nan"),
    ({"measurements": np.zeros((4, 3))}, "measurements has shape (4, 3)"),
    ({"measurements": np.zeros(4)}, "measurements has shape (4,)"),
    ({"measurements": np.zeros((0, 2))}, "measurements has shape (0, 2)"),
    ({"start": [0.0]}, "start has shape (1,)"),
    ({"radii": []}, "radii=[]"),
    ({"tested": [0]}, "tested=0"),
    ({"tested": [3]}, "tested=3"),
    ({"tested": []}, "tested=[]"),
    ({"alpha": 0.5}, "alpha=0.5"),
    ({"alpha": 0.4, "beta": 0.6}, "alpha + beta=1.0"),
    ({"margin": -1.0}, "margin=-1.0"),
    ({"published_root": 1}, "published_root=1"),
]


@pytest.mark.parametrize(("arguments", "message"), INVALID)
def test_an_invalid_argument_raises_a_one_line_error_with_its_name(arguments, message):
    with pytest.raises(ArgumentError) as caught:
        detect_switch(**({"measurements": np.zeros((4, 2))} | arguments))
    assert message in str(caught.value)
    assert "expected" in str(caught.value)
    assert "\n" not in str(caught.value)
