"""The whole study: small, killed and resumed, and at the size of the thesis."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from agents.interface.parallel import Workers
from baselines.papers.novospaskyi import reproduce, tables
from baselines.papers.novospaskyi.published import METRICS, TABLES, TEST_ERRORS, UNFILTERED
from hybrid_env.checks import ArgumentError

ROOT = Path(__file__).parents[4]
SCRIPT = """
import json, sys
from pathlib import Path
from agents.interface.parallel import Workers
from baselines.papers.novospaskyi import reproduce

if __name__ == "__main__":
    folder, workers = Path(sys.argv[1]), int(sys.argv[2])
    result = reproduce(1, 0, folder=folder, flights=6, trials=4, run=Workers(workers).results)
    values = [cell.as_json() for cell in result.cells] + [vars(finding) for finding in result.findings]
    (folder / "result.json").write_text(json.dumps(values))
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    seen = []
    folder = tmp_path_factory.mktemp("small")
    result = reproduce(2, 0, folder=folder, flights=6, trials=1, progress=lambda *state: seen.append(state))
    return result, seen, folder


def test_a_small_study_has_all_tables_and_shows_its_progress(small):
    result, seen, folder = small
    assert len(result.tables) == 6
    assert {len(cells) for cells in result.tables.values()} == {20, 16, 36}
    assert all(np.isfinite([cell.ours, cell.low, cell.high]).all() for cell in result.cells)
    published = [cell.published for cell in result.tables[TABLES["levy"]][:4]]
    assert tuple(published) == TEST_ERRORS["levy"][UNFILTERED]
    assert {stage for stage, _, _ in seen} == {"tuning", "test flights"}
    assert all(done <= total for _, done, total in seen)
    example = result.examples["flight"]
    assert set(example.estimates["gaussian"]) > {"g-h", "CV", tables.as_published("KF CV")}
    assert all(
        len(positions) == len(example.scan.times) for positions, _ in example.estimates["levy"].values()
    )
    assert len(list(folder.glob("point-mass/*.jsonl"))) == 22


def test_unfiltered_cells_are_the_noise_itself(small):
    result, _, _ = small
    cells = dict(zip(METRICS, result.tables[TABLES["gaussian"]], strict=False))
    # 4 standard errors of a deviation from about 2 runs x 4 flights x 70 measurements x 3 axes
    assert cells[METRICS[0]].ours == pytest.approx(12.5, rel=4.0 / np.sqrt(2 * 1680) + 0.01)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [({"runs": 0}, "runs"), ({"seed": -1}, "seed"), ({"flights": 3}, "flights"), ({"trials": 0}, "trials")],
)
def test_bad_arguments_are_refused_in_one_line(arguments, named, tmp_path):
    with pytest.raises(ArgumentError, match=rf"^{named}="):
        reproduce(**arguments, folder=tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(ArgumentError, match=r"^folder="):
        reproduce(folder=tmp_path / "file")


def start(script, folder, workers):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    arguments = [sys.executable, str(script), str(folder), str(workers)]
    return subprocess.Popen(arguments, env=environment, cwd=folder)


@pytest.mark.study
@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_run_resumes_with_the_same_bytes(tmp_path, workers):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    for folder in (whole, parts):
        folder.mkdir()
    assert start(script, whole, 1).wait() == 0
    tuned = parts / "point-mass"
    for enough in (20, 60):
        process = start(script, parts, workers)
        while process.poll() is None and sum(file.stat().st_size for file in tuned.glob("*")) < enough * 120:
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert not (parts / "result.json").exists()
    assert start(script, parts, workers).wait() == 0
    assert (parts / "result.json").read_bytes() == (whole / "result.json").read_bytes()
    assert len(json.loads((whole / "result.json").read_text())) > 100


@pytest.mark.study
def test_the_published_pattern_and_the_better_filters(tmp_path):
    result = reproduce(folder=tmp_path, run=Workers(os.cpu_count() or 1).results)
    ours = {(cell.table, cell.row, cell.column): cell.ours for cell in result.cells}
    position, velocity = METRICS[0], METRICS[2]
    for noise, table in TABLES.items():
        for metric, published in zip(METRICS, TEST_ERRORS[noise][UNFILTERED], strict=True):
            assert ours[table, UNFILTERED, metric] == pytest.approx(published, rel=0.03)
        assert ours[table, "KF CA", position] < ours[table, "KF CJ", position]
        assert ours[table, "g-h", velocity] < ours[table, "KF CA", velocity] < ours[table, "KF CJ", velocity]
    gaussian, levy = (f"Sound settings, {name}" for name in tables.NOISE_NAMES.values())
    errors = {
        row: value for (table, row, metric), value in ours.items() if (table, metric) == (gaussian, position)
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
