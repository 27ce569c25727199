"""`hybridtrack compare`: its files, and a comparison that goes on with its agents."""

import json
import shlex

import pytest
from small_training import small_recipe

from agents.cli import main
from agents.training.algorithm import Algorithm


def test_compare_writes_figures_and_data(tmp_path, capsys):
    line = (
        "compare threshold cusum shipped --env HybridTrackQuickest-v0 --ticks 40"
        f" --durations 'uniform 8-15' --episodes 8 --selection-episodes 6 --out {tmp_path}"
    )

    assert main(shlex.split(line)) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"compare.json", "compare.png"}
    assert "shipped and IMM threshold differ most" in capsys.readouterr().out
    data = json.loads((tmp_path / "compare.json").read_text())
    names = [decider["name"] for decider in data["deciders"]]
    assert names == ["IMM threshold", "CUSUM", "shipped"]
    for decider in data["deciders"]:
        chosen = decider["curve"]["thresholds"].index(decider["threshold"]["value"])
        assert decider["reward"]["value"] == pytest.approx(decider["curve"]["reward"][chosen])


# A process whose memory has grown is replaced.
@pytest.mark.filterwarnings("ignore:A worker stopped")
@pytest.mark.parametrize("jobs", ["1", pytest.param("2", marks=pytest.mark.study)])
def test_an_interrupted_comparison_goes_on_with_the_same_results(jobs, tmp_path, monkeypatch):
    """As a whole one, in this process or in two; the training is interrupted half-way."""
    line = (
        f"compare fixed {small_recipe(tmp_path)} --episodes 4 --selection-episodes 4"
        " --scheme 'random 2x20-25' --seed 5 --steps 1280"
    )
    command = shlex.split(line)
    assert main([*command, "--jobs", jobs, "--out", str(tmp_path / "whole")]) == 0
    between_updates = Algorithm.between_updates

    def stop(self):
        between_updates(self)
        if self.num_timesteps:
            self.save()
            raise KeyboardInterrupt

    interrupted = [*command, "--jobs", "1", "--out", str(tmp_path / "interrupted")]
    with monkeypatch.context() as patch:
        patch.setattr(Algorithm, "between_updates", stop)
        assert main(interrupted) == 130
    (agent,) = (tmp_path / "interrupted" / "agents").iterdir()
    assert (agent / "checkpoint.pt").is_file()

    assert main(interrupted) == 0
    whole, again = (tmp_path / name / "compare.json" for name in ("whole", "interrupted"))
    assert again.read_bytes() == whole.read_bytes()


def test_a_comparison_shows_the_bound_less_the_best_rule(tmp_path, capsys):
    line = f"compare at-once msprt --episodes 30 --selection-episodes 10 --out {tmp_path}"
    assert main(line.split()) == 0
    data = json.loads((tmp_path / "compare.json").read_text())
    at_once, rule = (decider["reward"]["value"] for decider in data["deciders"])
    bound = data["bound"]["reward"]["value"]
    assert at_once < 0.0 < rule
    assert data["best_rule"] == "MSPRT"
    assert data["bound"]["less"]["value"] == pytest.approx(bound - rule)
    assert data["bound"]["less"]["high"] > 0.0
    assert "bound: no rule earns more" in capsys.readouterr().out
