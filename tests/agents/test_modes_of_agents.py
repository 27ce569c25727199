"""Agents of modes other than straight motion and turns: training, run folders and commands."""

import json
import warnings

import numpy as np
import pytest
from own_modes import Halt
from small_training import KINDS, small_run

from agents.commands.compare import Compare
from agents.evaluation.registry import find_decider
from agents.evaluation.task import task_of
from baselines.rules.rollout import record_decisions
from hybrid_env import ArgumentError, WorldOptions
from hybrid_env.modes import LinearMode, Straight

MODES = "straight, stop, left 5, accelerate 1"
ENVS = {True: "hybrid_env:HybridTrackQuickest-v0", False: "hybrid_env:HybridTrack-v0"}
REFUSED = f"^modes='{MODES}' is not allowed: expected straight motion, left and right turns"


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


def test_a_policy_declares_the_types_of_the_modes(tmp_path):
    modes = "stop, left 5, left 2, straight"
    run = small("ppo", tmp_path / "run", modes=modes, actions="types")
    run.train()
    options = WorldOptions(modes=modes)
    decider = find_decider(str(tmp_path / "run"), options)
    assert decider.actor.actions == 4
    decisions = record_decisions(
        decider.at(-30.0), episodes=3, modes=modes, scheme="random 2x20-30"
    )
    assert set(np.unique(decisions.decided_mode)) <= set(range(4))


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


@pytest.mark.parametrize("name", ["shipped", "propagated", "msprt-kept"])
def test_deciders_of_turns_refuse_modes_by_name(name):
    with pytest.raises(ArgumentError, match=REFUSED):
        find_decider(name, WorldOptions(modes=MODES))


def test_the_usual_deciders_apply_to_the_modes():
    for env, given in ((ENVS[False], {}), (ENVS[True], {"ticks": 60})):
        command = Compare(env=env, modes=MODES, **given).completed()
        assert "shipped" not in command.deciders
        assert len(command.looked_up) > 3
