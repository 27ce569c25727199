"""Published tables against the sampling interval of a study of their size, offline and in the environment."""

import math
from pathlib import Path

import numpy as np
import pytest

from agents.cli import main
from baselines import SPRTDecider
from baselines.papers import golubkov2018, golubkov2020, tsyganov2019, zimchuk
from baselines.papers.reproduction import Cell, study_interval
from baselines.rules.decisions import evaluate
from hybrid_env.checks import ArgumentError

RUNS = 400  # of the quick tests; the table of the documentation has 1000


def test_golubkov_2018_tables_are_reproduced():
    result = golubkov2018.reproduce(RUNS, seed=0)
    count = result.count()
    assert sum(total for name, (_, total) in count.items() if not name.startswith("Table 2")) == 39
    inside = sum(inside for name, (inside, _) in count.items() if not name.startswith("Table 2"))
    assert inside >= 36
    known_modes = result.tables["Table 2, RMSE with known modes"]
    # R2 is close to the edge of its interval; the bound is 2.7 standard errors of a study of the paper's size
    for cell in known_modes:
        if cell.column == "nRMSE":
            assert abs(cell.published - cell.ours) < 0.7 * (cell.high - cell.low)
    assert sum(cell.verdict == "inside" for cell in known_modes) >= 10


def test_tsyganov_2019_table_is_reproduced_but_not_its_mode_accuracy():
    result = tsyganov2019.reproduce(RUNS, seed=0)
    ((inside, total),) = result.count().values()
    assert total == 10
    assert inside >= 9
    claims = [finding for finding in result.findings if finding.claim == "100 % correct"]
    assert len(claims) == 3
    for finding, percentage in zip(claims, (91.1, 89.6, 88.0), strict=True):
        # 9 pieces a run; errors within a run are correlated, with about three times the binomial variance
        bound = 4 * 100 * math.sqrt(3 * 0.09 / (9 * RUNS))
        assert float(finding.value.split()[0]) == pytest.approx(percentage, abs=bound)


def test_golubkov_2020_delay_is_within_the_distribution():
    result = golubkov2020.reproduce(runs=200, seed=0)
    cells = result.tables["Detection delay of the published realisation, ticks"]
    assert [cell.row for cell in cells if cell.verdict == "inside"][:2] == ["alpha = 0.1", "alpha = 0.05"]
    assert len(result.tables["Distribution of the delay"]) == 4 * 8


def test_environment_with_ate_reproduces_table_4_and_the_percentages():
    inside = total = 0
    for row, (name, variance) in enumerate(golubkov2018.MEASUREMENT_VARIANCES.items()):
        decisions = evaluate(
            SPRTDecider(golubkov2018.ALPHA), "hybrid_env:HybridTrackBank-v0", episodes=600, seed=10_000 * row,
            scheme="golubkov2018", heading=math.pi / 2, initial_error=0, measurement_variance=variance,
            undecided="keep",
        )  # fmt: skip
        ticks = np.concatenate([decisions.ticks, decisions.ticks.mean(1, keepdims=True)], axis=1)
        correct = 100.0 * decisions.type_correct.mean(1, keepdims=True)
        published = (*golubkov2018.TABLE_4[name], golubkov2018.CORRECT_MODES[name])
        _, low, high = study_interval(np.concatenate([ticks, correct], axis=1), lambda means: means, seed=1)
        inside += sum((low <= published) & (published <= high))
        total += len(published)
    assert total == 24
    assert inside >= 21


def test_study_interval_is_that_of_a_mean_of_100_runs():
    values = np.random.default_rng(0).normal(5.0, 2.0, (4000, 1))
    mean, low, high = study_interval(values, lambda means: means, seed=0)
    assert mean[0] == pytest.approx(values.mean())
    # with 2,000 resamples the standard error of a 2.5 % quantile is about 4 % of the half width
    assert high[0] - low[0] == pytest.approx(2 * 1.96 * 0.2, rel=0.1)


def test_verdict_of_a_cell():
    assert Cell("t", "r", "c", math.nan, 1.0, 0.0, 2.0).verdict == "not published"
    assert Cell("t", "r", "c", 2.5, 1.0, 0.0, 2.0).verdict == "outside"
    assert Cell("t", "r", "c", math.nan, 1.0, 0.0, 2.0).as_json()["published"] is None


@pytest.mark.parametrize("module", [golubkov2018, tsyganov2019, golubkov2020, zimchuk])
@pytest.mark.parametrize("runs", [1, 2.5, "many"])
def test_invalid_runs_raise(module, runs):
    with pytest.raises(ArgumentError, match=r"runs=.*expected an integer >= 2"):
        module.reproduce(runs=runs)


@pytest.mark.study
def test_the_table_of_the_documentation_is_up_to_date(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "papers.md").read_text()
    shown = page.split("<!-- reproduction -->\n")[1].split("<!-- /reproduction -->")[0]
    assert main(["reproduce", "--out", str(tmp_path)]) == 0
    assert shown == (tmp_path / "reproduction.md").read_text()
