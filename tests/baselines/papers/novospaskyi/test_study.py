"""The study killed and resumed, and at the size of the thesis. A small one: tests/agents/reproduction."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from agents.interface.parallel import Workers
from baselines.papers.novospaskyi import reproduce, tables
from baselines.papers.novospaskyi.tables import METRICS, TABLES, TEST_ERRORS, UNFILTERED
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
