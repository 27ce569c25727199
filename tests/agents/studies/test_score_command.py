"""`hybridtrack score`: tables, JSON and picture, from files of any origin."""

import json

import numpy as np
import pytest

from agents.cli import main
from agents.studies.score_command import score_figure
from baselines.scoring.score import score


def write(path, tracks):
    lines = [f"{name},{time},{mode}" for name, modes in tracks.items() for time, mode in enumerate(modes)]
    path.write_text("\n".join(["track,t,mode", *lines]) + "\n")


@pytest.fixture
def files(tmp_path):
    truth = {"a": "AAAABBBBCCDDD", "b": "AAAABBBBBBBBB", "c": "BBBAAAAAAAAAA"}
    late = {name: modes[:1] + modes[:-1] for name, modes in truth.items()}
    mine = {"c": "BBBBBAAAAAAAA", "a": "ACAAAABBBBDDD", "b": "AAAABBBBBBBBB"}
    for name, tracks in (("truth", truth), ("late", late), ("mine", mine)):
        write(tmp_path / f"{name}.csv", tracks)
    return tmp_path


def test_it_prints_and_writes_what_the_function_finds(files, capsys):
    line = [str(files / f"{name}.csv") for name in ("truth", "late", "mine")]
    out, picture = files / "score.json", files / "score.png"
    assert main(["score", *line, "--out", str(out), "--picture", str(picture), "--per", "min", "--normal", "A"]) == 0
    printed = capsys.readouterr().out
    for words in ("3 tracks, 0.6 min scored", "over tracks", "Less that of late", "/min", "away from A"):
        assert words in printed
    data = json.loads(out.read_text())
    assert data["figures"]["late"]["delay"]["value"] == pytest.approx(1.0)
    assert data["figures"]["mine"]["delay"]["value"] == pytest.approx((2 + 0 + 0 + 2) / 4)
    assert data["figures"]["mine"]["misses"]["value"] == pytest.approx(1 / 5)
    assert data["figures"]["mine"]["false_changes"]["value"] == pytest.approx(60.0 / 36)
    assert data["less_first"]["mine"]["delay"]["value"] == pytest.approx(0.0)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_single_short_track_has_no_intervals(files, capsys):
    for name, modes in (("one", "AAB"), ("two", "AAB")):
        write(files / f"{name}.csv", {name: modes})
    assert main(["score", str(files / "one.csv"), str(files / "two.csv")]) == 0
    printed = capsys.readouterr().out
    assert "No intervals" in printed
    assert "±" not in printed


def test_a_track_that_is_missing_is_one_line(files, capsys):
    write(files / "some.csv", {"a": "AAB", "b": "AAB"})
    assert main(["score", str(files / "truth.csv"), str(files / "some.csv")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "also c" in line


def test_the_picture_has_a_row_for_each_set_and_at_most_four_tracks():
    times, modes = np.arange(10.0), np.repeat([0, 1], 5)
    result = score([times] * 6, [modes] * 6, {"x": [modes] * 6, "y": [1 - modes] * 6})
    axes = score_figure(result).axes
    assert len(axes) == 4
    assert [label.get_text() for label in axes[0].get_yticklabels()] == ["truth", "x", "y"]
