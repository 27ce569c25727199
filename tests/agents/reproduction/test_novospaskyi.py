"""The command `hybridtrack reproduce novospaskyi` and its figures."""

import json
from functools import partial

import pytest
from PIL import Image

from agents.cli import main
from agents.reproduction import command
from baselines.papers import novospaskyi


def test_the_radar_study_prints_tables_and_draws_figures(monkeypatch, capsys, tmp_path):
    small = partial(novospaskyi.reproduce, flights=6, trials=1)
    monkeypatch.setattr(novospaskyi, "reproduce", small)
    monkeypatch.setattr(command, "MOST_PROCESSES", 1)
    assert main(["reproduce", "novospaskyi", "--runs", "2", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    for words in ("Table 3.5, Gaussian noise", "KF CJ", "2 runs, seed 0", "sound CV"):
        assert words in printed
    names = {path.name for path in tmp_path.iterdir()}
    figures = {"novospaskyi_flight.png", "novospaskyi_errors.png", "novospaskyi_kf_cv.png"}
    assert names == figures | {"novospaskyi.md", "novospaskyi.json", "reproduction.md", "novospaskyi"}
    for name in figures:
        with Image.open(tmp_path / name) as image:
            assert image.width > 1000
    cells = json.loads((tmp_path / "novospaskyi.json").read_text())["cells"]
    assert len(cells) == 2 * (20 + 16 + 36)
    assert {cell["verdict"] for cell in cells} >= {"inside", "outside", "not published"}


@pytest.mark.parametrize("papers", [[], ["golubkov2018"]])
def test_physics_is_refused_for_other_papers(papers, capsys, tmp_path):
    assert main(["reproduce", *papers, "--physics", "--out", str(tmp_path)]) == 2
    assert "novospaskyi, with --physics" in " ".join(capsys.readouterr().err.split())
