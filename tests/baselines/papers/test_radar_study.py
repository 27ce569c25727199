"""The radar study: tuning that is killed and resumed, gains of KF CV, the study at the size of
the thesis.

A small study: tests/agents/reproduction.
"""

import itertools
import math
import os

import pytest
from optuna.distributions import FloatDistribution, IntDistribution

from agents.interface.parallel import Workers
from baselines.estimation.kalman import KalmanFilter
from baselines.estimation.motion_models import MotionModel
from baselines.papers.adaptive import GHFilter
from baselines.papers.novospaskyi import reproduce, tables
from baselines.papers.novospaskyi.filters import Contender
from baselines.papers.novospaskyi.study import one_by_one
from baselines.papers.novospaskyi.tables import (
    METRICS,
    TABLES,
    TEST_ERRORS,
    UNFILTERED,
    steady_gains,
)
from baselines.papers.novospaskyi.tuning import finished_trials, tune
from hybrid_env.checks import ArgumentError

SPACE = {"q": FloatDistribution(1e-3, 1e3, log=True), "window": IntDistribution(1, 9)}
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


def test_a_file_that_cannot_be_read_or_written_is_one_line(tmp_path):
    with pytest.raises(ArgumentError, match="cannot be read"):
        tune(CONTENDER, cost, 2, 0, tmp_path, "x")
    with pytest.raises(ArgumentError, match="cannot be written"):
        tune(CONTENDER, cost, 2, 0, tmp_path / "missing" / "trials.jsonl", "x")


@pytest.mark.parametrize(
    ("variance", "process", "step"),
    [(156.25, 4.0, 0.5), (9e-10, 0.003, 1.0), (1.0, 1.0, 2.0)],
)
def test_steady_gains_are_those_that_the_kalman_filter_reaches(variance, process, step):
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


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"runs": 0}, "runs"),
        ({"seed": -1}, "seed"),
        ({"flights": 3}, "flights"),
        ({"trials": 0}, "trials"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(arguments, named, tmp_path):
    with pytest.raises(ArgumentError, match=rf"^{named}="):
        reproduce(**arguments, folder=tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(ArgumentError, match=r"^folder="):
        reproduce(folder=tmp_path / "file")


def values(folder, run):
    """Everything that a small study gives."""
    result = reproduce(
        1,
        0,
        folder=folder,
        flights=6,
        trials=4,
        run=run,
    )
    return [cell.as_json() for cell in result.cells] + [
        vars(finding) for finding in result.findings
    ]


def killed(calls, on_done):
    """A run that fails like a killed process after some calls."""
    yield from itertools.islice(one_by_one(calls, on_done), 5)
    raise KilledError


@pytest.mark.study
@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_study_goes_on_to_the_same_values(tmp_path, workers):
    expected = values(tmp_path / "whole", one_by_one)
    assert len(expected) > 100
    for _ in range(2):
        with pytest.raises(KilledError):
            values(tmp_path / "parts", killed)
    assert values(tmp_path / "parts", Workers(workers).results) == expected


@pytest.mark.study
def test_the_published_pattern_and_the_better_filters(tmp_path):
    result = reproduce(folder=tmp_path, run=Workers(os.cpu_count() or 1).results)
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
