"""`hybridtrack compare` for unknown switches: tables and files."""

import json
import shlex

import pytest

from agents.cli import main

QUICKEST = "--env HybridTrackQuickest-v0"
SMALL = f"{QUICKEST} --ticks 80 --durations 'uniform 15-30'"


def test_compare_prints_tables_and_writes_figures_and_data(tmp_path, capsys):
    out = tmp_path / "results"
    line = (
        f"compare {SMALL} --deciders threshold cusum beam --episodes 8 --selection-episodes 6 --out"
        f" {out}"
    )

    assert main(shlex.split(line)) == 0
    printed = capsys.readouterr().out
    for words in (
        "8 tracks of 80 ticks",
        "IMM threshold",
        "CUSUM",
        "beam",
        "shipped",
        "operating curves",
    ):
        assert words in printed
    assert {path.name for path in out.iterdir()} == {"compare.json", "compare.png", "episode.png"}
    data = json.loads((out / "compare.json").read_text())
    assert data["plan"]["options"] == {"ticks": 80, "durations": "uniform 15-30"}
    assert data["plan"]["episodes"] == 8
    assert [decider["name"] for decider in data["deciders"]] == [
        "IMM threshold",
        "CUSUM",
        "beam",
        "shipped",
    ]
    for decider in data["deciders"]:
        chosen = decider["curve"]["thresholds"].index(decider["threshold"]["chosen"])
        assert decider["reward"]["value"] == pytest.approx(decider["curve"]["reward"][chosen])
