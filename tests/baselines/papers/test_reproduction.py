"""The papers' tables within the spread of a study of their size, and through the environment."""

import math

import numpy as np
import pytest

from agents.evaluation.evaluate import evaluate
from baselines import SPRTDecider
from baselines.papers import golubkov2018, golubkov2020, tsyganov2019
from baselines.papers.reproduction import Cell, study_spread
from hybrid_env.checks import ArgumentError


def test_golubkov_2018_comes_out():
    result = golubkov2018.reproduce(runs=1000, seed=0)
    count = result.count()
    assert sum(total for name, (_, total) in count.items() if not name.startswith("Table 2")) == 39
    inside = sum(found for name, (found, _) in count.items() if not name.startswith("Table 2"))
    assert inside >= 36
    known = result.tables["Table 2, RMSE with known modes"]
    # R2 lies near the edge of its interval, so the bound is 2.7 deviations of a study of the paper's size
    for cell in known:
        if cell.column == "nRMSE":
            assert abs(cell.published - cell.ours) < 0.7 * (cell.high - cell.low)
    assert sum(cell.verdict == "inside" for cell in known) >= 10


def test_tsyganov_2019_comes_out_and_its_claim_does_not():
    result = tsyganov2019.reproduce(runs=1000, seed=0)
    assert result.count() == {"Table, RMSE": (10, 10)}
    claims = [finding for finding in result.findings if finding.claim == "100 % right"]
    assert len(claims) == 3
    for finding, right in zip(claims, (91.1, 89.6, 88.0), strict=True):
        # of 9,000 pieces each; errors within a run hang together, about three times the binomial variance
        assert float(finding.value.split()[0]) == pytest.approx(
            right, abs=4 * 100 * math.sqrt(3 * 0.09 / 9000)
        )


def test_golubkov_2020_shows_its_delay_as_one_of_many():
    result = golubkov2020.reproduce(runs=200, seed=0)
    cells = result.tables["Delay of the one realisation shown, ticks"]
    assert [cell.row for cell in cells if cell.verdict == "inside"][:2] == ["alpha = 0.1", "alpha = 0.05"]
    assert len(result.tables["Distribution"]) == 4 * 8


def test_the_environment_with_ate_gives_table_4_and_the_percentages():
    inside = total = 0
    for row, (name, variance) in enumerate(golubkov2018.NOISE.items()):
        decisions = evaluate(
            SPRTDecider(golubkov2018.ALPHA), "hybrid_env:HybridTrackBank-v0", episodes=600, seed=10_000 * row,
            scheme="golubkov2018", heading=math.pi / 2, initial_error=0, measurement_variance=variance,
            undecided="keep",
        )  # fmt: skip
        ticks = np.concatenate([decisions.ticks, decisions.ticks.mean(1, keepdims=True)], axis=1)
        right = 100.0 * decisions.type_correct.mean(1, keepdims=True)
        published = (*golubkov2018.TABLE_4[name], golubkov2018.RIGHT_MODES[name])
        _, low, high = study_spread(np.concatenate([ticks, right], axis=1), lambda means: means, seed=1)
        inside += sum((low <= published) & (published <= high))
        total += len(published)
    assert total == 24
    assert inside >= 21


def test_the_spread_of_studies_is_that_of_the_mean_of_a_hundred_runs():
    values = np.random.default_rng(0).normal(5.0, 2.0, (4000, 1))
    middle, low, high = study_spread(values, lambda means: means, seed=0)
    assert middle[0] == pytest.approx(values.mean())
    # 2,000 resamples know a 2.5 % quantile to about 4 % of the half width
    assert high[0] - low[0] == pytest.approx(2 * 1.96 * 0.2, rel=0.1)


def test_a_cell_without_a_legible_figure_has_no_verdict():
    assert Cell("t", "r", "c", math.nan, 1.0, 0.0, 2.0).verdict == "no figure"
    assert Cell("t", "r", "c", 2.5, 1.0, 0.0, 2.0).verdict == "outside"
    assert Cell("t", "r", "c", math.nan, 1.0, 0.0, 2.0).as_json()["published"] is None


@pytest.mark.parametrize("module", [golubkov2018, tsyganov2019, golubkov2020])
@pytest.mark.parametrize("runs", [0, 1, 2.5, "many"])
def test_a_study_needs_runs(module, runs):
    with pytest.raises(ArgumentError, match=r"runs=.*expected an integer >= 2"):
        module.reproduce(runs=runs)


@pytest.mark.study
def test_the_readme_shows_what_the_command_prints(tmp_path):
    from pathlib import Path

    from agents.cli import main

    readme = (Path(__file__).parents[3] / "README.md").read_text()
    shown = readme.split("<!-- reproduction -->\n")[1].split("<!-- /reproduction -->")[0]
    assert main(["reproduce", "--out", str(tmp_path)]) == 0
    assert shown == (tmp_path / "reproduction.md").read_text()
