"""The radar study: tuning that is killed and resumed, gains of KF CV, the study at the size of
the thesis.
"""

import math
import os

import pytest
from optuna.distributions import FloatDistribution, IntDistribution

from baselines.estimation.gain_filters import GHFilter
from baselines.estimation.kalman import KalmanFilter
from baselines.estimation.motion_models import MotionModel
from studies.radar import tables
from studies.radar.filters import Contender
from studies.radar.reproduction import reproduce
from studies.radar.tables import (
    METRICS,
    TABLES,
    TEST_ERRORS,
    UNFILTERED,
    steady_gains,
)
from studies.radar.tuning import finished_trials, tune

SPACE = {
    "q": FloatDistribution(1e-3, 1e3, log=True),
    "window": IntDistribution(1, 9),
}
START = {"q": 1.0, "window": 5}
CONTENDER = Contender(GHFilter, SPACE, START)


def cost(parameters):
    return (math.log(parameters["q"]) - 2.0) ** 2 + (parameters["window"] - 3) ** 2


class KilledError(Exception):
    pass


def killed_after(evaluations):
    """The cost, which fails like a killed process after some evaluations."""
    left = [evaluations]

    def limited(parameters):
        left[0] -= 1
        if left[0] < 0:
            raise KilledError
        return cost(parameters)

    return limited


def test_a_tuning_killed_anywhere_ends_with_the_same_bytes(tmp_path):
    whole = tmp_path / "whole.jsonl"
    parts = tmp_path / "parts.jsonl"
    best = tune(CONTENDER, cost, 25, 7, whole, "x")

    assert cost(best) < cost(START)
    for evaluations in (0, 1, 12):
        with pytest.raises(KilledError):
            tune(CONTENDER, killed_after(evaluations), 25, 7, parts, "x")
    assert tune(CONTENDER, cost, 25, 7, parts, "x") == best
    assert parts.read_bytes() == whole.read_bytes()
    # Nothing is evaluated again.
    assert tune(CONTENDER, killed_after(0), 25, 7, parts, "x") == best


def test_torn_repeated_and_foreign_lines_do_no_harm(tmp_path):
    file = tmp_path / "trials.jsonl"
    best = tune(CONTENDER, cost, 12, 7, file, "x")
    lines = file.read_bytes()
    # Cut off within a line and a character.
    file.write_bytes(lines[: len(lines) // 2] + b"\xc3")

    assert tune(CONTENDER, cost, 12, 7, file, "x") == best
    # Two processes did the same work.
    file.write_bytes(lines + lines)
    assert tune(CONTENDER, killed_after(0), 12, 7, file, "x") == best
    assert finished_trials(file, "y") == []
    with pytest.raises(KilledError):
        tune(CONTENDER, killed_after(0), 12, 7, file, "y")
    file.write_bytes(lines + b'7\n{"fingerprint": "x"}\n[]\n')
    assert len(finished_trials(file, "x")) == 12


@pytest.mark.parametrize(
    ("variance", "process", "step"),
    [(156.25, 4.0, 0.5), (9e-10, 0.003, 1.0), (1.0, 1.0, 2.0)],
)
def test_steady_gains_are_those_that_the_kalman_filter_reaches(
    variance,
    process,
    step,
):
    model = MotionModel("CV", axes=1, noise=process, discretization="discrete")
    kalman = KalmanFilter(model, variance, start_deviations=(1.0,))
    kalman.begin(1)
    kalman.update([[0.0]])
    for _ in range(2000):
        kalman.predict(step)
        kalman.update([[0.0]])
    kalman.predict(step)
    before = kalman.state.copy()
    kalman.update(before[:, :1] + 1.0)
    g, h = (kalman.state - before)[0] * (1.0, step)

    assert steady_gains(variance, process, step) == pytest.approx((g, h), rel=1e-6)


@pytest.mark.study
def test_the_published_pattern_and_the_better_filters(tmp_path):
    result = reproduce(folder=tmp_path, jobs=os.cpu_count() or 1)
    ours = {(cell.table, cell.row, cell.column): cell.ours for cell in result.cells}
    position = METRICS[0]
    velocity = METRICS[2]
    for noise, table in TABLES.items():
        for metric, published in zip(METRICS, TEST_ERRORS[noise][UNFILTERED], strict=True):
            assert ours[table, UNFILTERED, metric] == pytest.approx(published, rel=0.03)
        assert ours[table, "KF CA", position] < ours[table, "KF CJ", position]
        assert (
            ours[table, "g-h", velocity]
            < ours[table, "KF CA", velocity]
            < ours[table, "KF CJ", velocity]
        )
    gaussian, levy = (f"Sound settings, {name}" for name in tables.NOISE_NAMES.values())
    errors = {
        row: value
        for (table, row, metric), value in ours.items()
        if (table, metric) == (gaussian, position)
    }
    unfiltered = ours[TABLES["gaussian"], UNFILTERED, position]

    assert errors["CV"] <= 0.75 * unfiltered
    assert errors["IMM (CV, CA)"] < errors["CV"] < min(errors["CA"], errors["g-h, plain"])
    assert max(errors["CA"], errors["g-h, plain"]) < errors["CJ"]
    plain = ours[levy, "CV", position]
    robust = {name: ours[levy, name, position] / plain for name in ("CV, Huber", "CV, Student-t")}
    assert min(robust.values()) <= 0.70
    assert max(errors[name] / errors["CV"] for name in robust) <= 1.01
    published_cv = ours[f"{TABLES['gaussian']}, with the published parameters", "KF CV", velocity]
    assert published_cv > 10.0 * ours[TABLES["gaussian"], "KF CV", velocity]
