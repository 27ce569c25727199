"""Algorithms are found by the name of their file, and those outside of the package by their
class.
"""

import sys

import pytest
from small_training import SCHEME

from agents.evaluation.registry import find_decider
from agents.learned.algorithm_names import find_algorithm
from agents.training.recipe import load_recipe
from agents.training.runs import make_run, resume_run
from hybrid_env import ArgumentError, WorldOptions

ENV = "hybrid_env:HybridTrackPublished-v0"
SOURCE = """
from small_network import Small

class Mine(Small):
    pass
"""
RECIPE = """
default: {algo: "own_algorithm:Mine", n_timesteps: 200, hidden: 4, n_envs: 4, learning_rate: 0.01}
"""


@pytest.mark.parametrize("name", ["magic", "json:loads", 3])
def test_other_names_are_refused_in_one_line(name):
    with pytest.raises(ArgumentError, match="algo="):
        find_algorithm(name, imported=True)


def test_weights_name_an_algorithm_of_a_user_which_they_do_not_import(tmp_path, monkeypatch):
    (tmp_path / "own_algorithm.py").write_text(SOURCE)
    (tmp_path / "mine.yml").write_text(RECIPE)
    monkeypatch.syspath_prepend(tmp_path)
    run = make_run(ENV, SCHEME, load_recipe(str(tmp_path / "mine.yml"), ENV), 0, tmp_path / "run")
    run.train()
    options = WorldOptions(**SCHEME)

    assert type(run).__name__ == "Mine"
    assert find_decider(str(tmp_path / "run"), options).hypotheses is None
    assert resume_run(tmp_path / "run").num_timesteps == run.num_timesteps

    monkeypatch.delitem(sys.modules, "own_algorithm")
    monkeypatch.delitem(find_algorithm.__globals__["REGISTERED"], "own_algorithm:Mine")
    for use in (lambda folder: find_decider(str(folder), options), resume_run):
        with pytest.raises(ArgumentError, match="a2c, dqn"):
            use(run.folder)
    assert "own_algorithm" not in sys.modules
