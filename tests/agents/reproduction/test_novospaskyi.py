"""The command `hybridtrack reproduce novospaskyi`: a small study, its tables and figures."""

import json

import numpy as np
import pytest
from PIL import Image

from agents.cli import main
from baselines.papers import novospaskyi
from baselines.papers.novospaskyi.tables import (
    METRICS,
    TABLES,
    TEST_ERRORS,
    UNFILTERED,
    as_published,
)

FIGURES = {
    "novospaskyi_flight.png",
    "novospaskyi_errors.png",
    "novospaskyi_mae.png",
    "novospaskyi_kf_cv.png",
}


def test_a_small_radar_study_prints_tables_and_draws_figures(monkeypatch, capsys, tmp_path):
    results = []
    seen = []

    def small(progress, **options):
        def show(*state):
            seen.append(state)
            progress(*state)

        results.append(study(**options, flights=6, trials=1, progress=show))
        return results[0]

    study = novospaskyi.reproduce
    monkeypatch.setattr(novospaskyi, "reproduce", small)

    assert (
        main(["reproduce", "novospaskyi", "--runs", "2", "--jobs", "1", "--out", str(tmp_path)])
        == 0
    )
    printed = capsys.readouterr().out
    for words in ("Table 3.5, Gaussian noise", "KF CJ", "2 runs, seed 0", "sound CV"):
        assert words in printed
    names = {path.name for path in tmp_path.iterdir()}
    assert names == FIGURES | {
        "novospaskyi.md",
        "novospaskyi.json",
        "reproduction.md",
        "novospaskyi",
    }
    for name in FIGURES:
        with Image.open(tmp_path / name) as image:
            assert image.width > 1000
    assert len(list(tmp_path.glob("novospaskyi/point-mass/*.jsonl"))) == 23
    assert {stage for stage, _, _ in seen} == {"tuning", "test flights"}
    for stage in ("tuning", "test flights"):
        done = [state[1] for state in seen if state[0] == stage]
        assert (done[0], done[-1]) == (0, next(state[2] for state in seen if state[0] == stage))
    check(results[0], json.loads((tmp_path / "novospaskyi.json").read_text())["cells"])


def check(result, cells):
    """Tables and example of a study with 6 flights and 2 seeds of the noise."""
    assert len(cells) == 2 * (20 + 16 + 40)
    assert {cell["verdict"] for cell in cells} >= {"inside", "outside", "not published"}
    assert [len(cells) for cells in result.tables.values()] == [20, 20, 16, 16, 40, 40]
    assert all(np.isfinite([cell.ours, cell.low, cell.high]).all() for cell in result.cells)
    published = [cell.published for cell in result.tables[TABLES["levy"]][:4]]
    assert tuple(published) == TEST_ERRORS["levy"][UNFILTERED]
    # Unfiltered, the error is the noise itself: 4 standard errors of a deviation from about 2 runs
    # x 4 flights x 70 measurements x 3 axes.
    unfiltered = dict(zip(METRICS, result.tables[TABLES["gaussian"]], strict=False))
    assert unfiltered[METRICS[0]].ours == pytest.approx(12.5, rel=4.0 / np.sqrt(2 * 1680) + 0.01)
    example = result.examples["flight"]
    assert set(example.estimates["gaussian"]) > {"g-h", "CV", as_published("KF CV")}
    for positions, _ in example.estimates["levy"].values():
        assert len(positions) == len(example.scan.times)
