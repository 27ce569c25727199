"""The commands as Python functions give what the commands give."""

import json

import numpy as np
import pytest
from own_noise import Rounded
from small_training import SMALL_PPO

import agents
from agents.cli import main
from baselines import MSPRTDecider
from hybrid_env import StudentNoise

WORLD = {"scheme": "S20 L30r5"}


def first(rows):
    """Declare the first hypothesis at once."""
    return np.ones(len(rows), np.int64)


def test_evaluate_returns_the_figures_of_the_command(tmp_path):
    metrics = agents.evaluate("msprt:0.02", "HybridTrack-v0", episodes=10, seed=3, **WORLD)
    out = tmp_path / "out.json"
    flags = f"--episodes 10 --seed 3 --out {out} --scheme"

    assert main(["evaluate", "msprt:0.02", *flags.split(), WORLD["scheme"]]) == 0
    (figures,) = json.loads(out.read_text())
    assert figures["reward"] == metrics["reward"].as_json()
    for decider in (MSPRTDecider(0.02), agents.load("msprt:0.02", **WORLD)):
        again = agents.evaluate(decider, episodes=10, seed=3, **WORLD)
        assert again["accuracy"].as_json() == figures["accuracy"]


@pytest.mark.parametrize(
    ("law", "text"), [(StudentNoise(3.0), "student_t 3"), (Rounded(0.25), "Rounded 0.25")]
)
def test_a_run_folder_names_the_law_of_the_noise(law, text, tmp_path):
    folder = tmp_path / "run"
    given = {"steps": 1280, "changes": SMALL_PPO, "noise": law} | WORLD
    agents.train("ppo", out=folder, **given)

    assert json.loads((folder / "config.json").read_text())["options"]["noise"] == text


def test_compare_takes_names_and_functions():
    result = agents.compare(["msprt", first], episodes=4, selection_episodes=4, jobs=1, **WORLD)

    assert [entry.name for entry in result.entries] == ["MSPRT", "first"]
    assert result.picture().axes
