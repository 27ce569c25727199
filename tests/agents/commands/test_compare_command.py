"""`hybridtrack compare`: its files, and a comparison that goes on with its agents."""

import json
import shlex

import numpy as np
import pytest
from small_training import small_recipe

from agents import find_decider
from agents.cli import main
from agents.training.algorithm import Algorithm
from hybrid_env import WorldOptions


def compared(line, folder):
    """Return the data that a comparison writes, and those of its deciders by name."""
    assert main(shlex.split(f"compare {line} --out {folder}")) == 0
    assert {path.name for path in folder.iterdir()} == {"compare.json", "compare.png"}
    data = json.loads((folder / "compare.json").read_text())
    return data, {decider["name"]: decider for decider in data["deciders"]}


def test_unknown_switches_are_compared_at_equal_rates_of_wrong_changes(tmp_path, capsys):
    world = "--env HybridTrackQuickest-v0 --ticks 40 --durations 'uniform 8-15'"
    line = f"threshold cusum shipped {world} --episodes 8 --selection-episodes 6"
    _, deciders = compared(line, tmp_path)
    assert "shipped and IMM threshold differ most" in capsys.readouterr().out
    assert list(deciders) == ["IMM threshold", "CUSUM", "shipped"]
    for decider in deciders.values():
        curve = decider["curve"]
        chosen = curve["thresholds"].index(decider["threshold"]["value"])
        assert decider["reward"]["value"] == pytest.approx(curve["reward"][chosen])
    first, other = deciders["IMM threshold"], deciders["CUSUM"]
    name = "full_delay_at_equal_wrong_changes"
    for decider in (first, other):
        curve = decider["curve"]
        at_two = np.interp(-2.0, np.negative(curve["wrong_changes"]), curve["full_delay"])
        assert decider[name]["value"] == pytest.approx(at_two)
    ratio = other["against_reference"][name]["value"]
    assert ratio == pytest.approx(other[name]["value"] / first[name]["value"])


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


def test_announced_switches_are_compared_at_equal_times_and_with_the_bound(tmp_path, capsys):
    line = "sprt at-once msprt --episodes 30 --selection-episodes 10"
    data, deciders = compared(line, tmp_path)
    bound, rule = data["bound"]["reward"]["value"], deciders["MSPRT"]
    assert data["deciders"][1]["reward"]["value"] < 0.0 < rule["reward"]["value"]
    assert data["best_rule"] == "MSPRT"
    assert data["bound"]["less"]["value"] == pytest.approx(bound - rule["reward"]["value"])
    assert data["bound"]["less"]["high"] > 0.0
    assert "bound: no rule earns more" in capsys.readouterr().out
    first = deciders["SPRT"]["curve"]
    default = find_decider("sprt", WorldOptions()).default
    ticks = first["ticks"][first["thresholds"].index(default)]
    right = np.interp(ticks, rule["curve"]["ticks"], rule["curve"]["accuracy"])
    assert rule["equal_time_error"]["value"] == pytest.approx(1.0 - right)
