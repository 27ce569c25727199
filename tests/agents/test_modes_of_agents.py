"""Agents of modes other than straight motion and turns: training, run folders and commands."""

import json
import warnings

import numpy as np
import pytest
from own_modes import Halt
from small_training import KINDS, small_run

from agents.evaluation.registry import find_decider
from agents.evaluation.task import task_of
from hybrid_env import ArgumentError, WorldOptions
from hybrid_env.modes import LinearMode, Straight

MODES = "straight, stop, left 5, accelerate 1"
ENVS = {True: "hybrid_env:HybridTrackQuickest-v0", False: "hybrid_env:HybridTrack-v0"}


def small(kind, folder, **options):
    """A new run of a small agent."""
    recipe, env, given, changes = KINDS[kind]
    env = ENVS["Quickest" in env].removeprefix("hybrid_env:")
    return small_run(kind, folder, 640, 0, {kind: (recipe, env, given | options, changes)})


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "network"])
def test_an_algorithm_of_a_library_trains_on_any_modes(kind, tmp_path):
    run = small(kind, tmp_path / "run", modes=MODES)
    run.train()
    card = json.loads((tmp_path / "run" / "policy.json").read_text())
    assert card["options"]["modes"] == MODES
    decider = find_decider(str(tmp_path / "run"), run.world)
    assert decider.hypotheses == 4

    changes = {"modes": "straight, stop, left 5, accelerate -1"}
    other = task_of(run.env_id, run.options | changes)
    with pytest.raises(ArgumentError, match="of the types straight, stop, left, accelerate"):
        find_decider(str(tmp_path / "run"), other.options)


def test_modes_as_objects_are_saved_as_texts_and_as_matrices(tmp_path):
    modes = Straight(), LinearMode(np.eye(4), name="drift")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert modes[0].as_json() == "straight"
        small("ppo", tmp_path / "run", modes=modes).train()
    card = json.loads((tmp_path / "run" / "policy.json").read_text())
    assert WorldOptions(modes=card["options"]["modes"]).all_modes == modes
    assert find_decider(str(tmp_path / "run"), WorldOptions(modes=modes)).hypotheses == 2
    with pytest.warns(UserWarning, match="^mode 'halt' has no text"):
        Halt().as_json()
