"""`hybridtrack score`: JSON and picture, from files of any origin."""

import json

import pytest

from agents.cli import main


def write(path, tracks):
    lines = [
        f"{name},{time},{mode}" for name, modes in tracks.items() for time, mode in enumerate(modes)
    ]
    path.write_text("\n".join(["track,t,mode", *lines]) + "\n")


@pytest.fixture
def files(tmp_path):
    truth = {"a": "AAAABBBBCCDDD", "b": "AAAABBBBBBBBB", "c": "BBBAAAAAAAAAA"}
    late = {name: modes[:1] + modes[:-1] for name, modes in truth.items()}
    mine = {"c": "BBBBBAAAAAAAA", "a": "ACAAAABBBBDDD", "b": "AAAABBBBBBBBB"}
    for name, tracks in (("truth", truth), ("late", late), ("mine", mine)):
        write(tmp_path / f"{name}.csv", tracks)
    return tmp_path


def test_it_writes_what_the_function_finds(files):
    out = files / "score.json"
    picture = files / "score.png"
    line = [str(files / f"{name}.csv") for name in ("truth", "late", "mine")]
    line += f"--out {out} --picture {picture} --per min --normal A".split()

    assert main(["score", *line]) == 0
    data = json.loads(out.read_text())
    assert data["figures"]["late"]["delay"]["value"] == pytest.approx(1.0)
    assert data["figures"]["mine"]["delay"]["value"] == pytest.approx((2 + 0 + 0 + 2) / 4)
    assert data["figures"]["mine"]["misses"]["value"] == pytest.approx(1 / 5)
    assert data["figures"]["mine"]["false_changes"]["value"] == pytest.approx(60.0 / 36)
    assert data["less_first"]["mine"]["delay"]["value"] == pytest.approx(0.0)
    assert picture.read_bytes().startswith(b"\x89PNG")
