"""`hybridtrack compare`: tables and files, and a comparison that goes on with its agents."""

import json
import shlex

import pytest
from small_training import small_recipe

from agents.cli import main
from agents.training.algorithm import Algorithm


def test_compare_prints_tables_and_writes_figures_and_data(tmp_path, capsys):
    line = (
        "compare --env HybridTrackQuickest-v0 --ticks 80 --durations 'uniform 15-30' --deciders"
        f" threshold cusum beam --episodes 8 --selection-episodes 6 --out {tmp_path}"
    )

    assert main(shlex.split(line)) == 0
    printed = capsys.readouterr().out
    names = ["IMM threshold", "CUSUM", "beam", "shipped"]
    for words in ("640 ticks", *names, "operating curves"):
        assert words in printed
    assert {path.name for path in tmp_path.iterdir()} == {
        "compare.json",
        "compare.png",
        "episode.png",
    }
    data = json.loads((tmp_path / "compare.json").read_text())
    assert data["plan"]["options"] == {"ticks": 80, "durations": "uniform 15-30"}
    assert [decider["name"] for decider in data["deciders"]] == names
    for decider in data["deciders"]:
        chosen = decider["curve"]["thresholds"].index(decider["threshold"]["value"])
        assert decider["reward"]["value"] == pytest.approx(decider["curve"]["reward"][chosen])


# A process whose memory has grown is replaced.
@pytest.mark.filterwarnings("ignore:A worker stopped")
def test_an_interrupted_comparison_goes_on_with_the_same_results(tmp_path, monkeypatch, capsys):
    """In one process and in two, of which one is interrupted in the second of two rounds."""
    line = (
        "compare --episodes 4 --selection-episodes 4 --deciders ml fixed --scheme 'random 2x20-25'"
        f" --seed 5 --agents {small_recipe(tmp_path)} --steps 1280 --training-seeds 2"
    )
    command = shlex.split(line)
    assert main([*command, "--jobs", "2", "--out", str(tmp_path / "two")]) == 0
    whole = Algorithm.between_updates

    def stop(self):
        whole(self)
        if self.num_timesteps:
            self.save()
            raise KeyboardInterrupt

    one = [*command, "--jobs", "1", "--out", str(tmp_path / "one")]
    with monkeypatch.context() as patch:
        patch.setattr(Algorithm, "between_updates", stop)
        assert main(one) == 130
    assert "the same command continues" in capsys.readouterr().err
    (agent,) = (tmp_path / "one" / "agents").iterdir()
    assert (agent / "checkpoint.pt").is_file()

    assert main(one) == 0
    for name in ("compare.json", "compare.png", "episode.png"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
