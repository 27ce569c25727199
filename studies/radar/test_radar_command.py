"""The command: the quick forms of its parts."""

import json

import numpy as np
import pytest

from agents import run_command
from studies.radar.__main__ import Radar
from studies.radar.reproduction import reproduce
from studies.radar.tables import METRICS, TABLES, TEST_ERRORS, UNFILTERED, as_published

pytest.importorskip("pyarrow")


@pytest.mark.parametrize(
    ("part", "figures"),
    [("data", 0), ("scores", 1), ("thesis", 4)],
)
def test_the_quick_form_writes_its_files(
    part,
    figures,
    tmp_path,
):
    arguments = [part, "--quick", "--jobs", "1", "--out", str(tmp_path)]
    assert run_command(Radar, "radar", arguments) == 0
    assert len(list(tmp_path.glob("*.png"))) == figures
    if part == "scores":
        scores = json.loads((tmp_path / "scores.json").read_text())
        assert [len(filters) for filters in scores.values()] == [12, 12]


def test_a_small_study_has_all_tables(tmp_path):
    result = reproduce(2, folder=tmp_path, flights=6, trials=1)
    cells = [cell.as_json() for cell in result.cells]
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
