"""Run folders that were damaged, or written to do damage, are refused in one line."""

import json
import os
import shutil

import numpy as np
import pytest
import torch
from hostile_input import accepted, attack, counts, damaged, mutated, refused
from safetensors.torch import load_file, save_file
from small_training import log_often, small_run

from agents.evaluation.registry import load_decider, policy_folder
from agents.interface.world_arguments import WorldArguments
from agents.learned.policy_file import CARD, WEIGHTS
from baselines.rules.decider import ANNOUNCED, UNKNOWN
from hybrid_env import WorldOptions
from hybrid_env.registration import make_track_vector_env


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(policy_folder("shipped", ANNOUNCED), tmp_path / "run")
    return tmp_path / "run"


def refusal(folder):
    """The message with which the folder is refused."""
    return refused(load_decider, str(folder), WorldOptions())


def test_weights_of_another_type_shape_or_size_are_refused(folder):
    weights = load_file(folder / WEIGHTS)
    name = "anchor.output.bias"
    others = {key: value for key, value in weights.items() if key != name}
    large = {name: weights[name] - 1e30}
    for changed in ({name: weights[name].double()}, {name: torch.zeros(3)}, large, {}):
        save_file(others | changed, folder / WEIGHTS)
        assert name in refusal(folder)


def test_files_that_are_too_large_or_would_block_are_refused(folder):
    # Sparse.
    os.truncate(folder / WEIGHTS, 2**40)
    assert "larger than" in refusal(folder)
    for name in (WEIGHTS, CARD):
        (folder / name).unlink()
        os.mkfifo(folder / name)
        refusal(folder)


def decide(folder):
    """Load the decider of a run folder as a command does; it then decides on some ticks."""
    env_id, options = WorldArguments().world_of(str(folder))
    env = make_track_vector_env(env_id, 3, **options)
    decider = load_decider(str(folder), env.options)
    rows = env.reset(seed=0)[0]
    state = None
    for _ in range(3):
        actions, state = decider.predict(rows, state, np.zeros(3, np.bool_))
        assert actions.shape == (3,)
        rows = env.step(actions)[0]
    return actions


@pytest.fixture(scope="module", params=["ppo", "robust"])
def trained(request, tmp_path_factory):
    if request.param == "robust":
        return policy_folder("robust", UNKNOWN)
    folder = tmp_path_factory.mktemp("run")
    with pytest.MonkeyPatch.context() as patch:
        log_often(patch.setattr)
        small_run(request.param, folder, 640).train()
    return folder


@pytest.fixture
def saved(trained, tmp_path):
    for name in (CARD, WEIGHTS):
        shutil.copy(trained / name, tmp_path)
    # It compiles too, which takes longer than an example may.
    decide(tmp_path)
    return tmp_path


EXAMPLES = pytest.mark.parametrize("examples", counts(20, 4_000))


@EXAMPLES
def test_a_card_with_one_changed_value_is_used_or_refused(saved, examples):
    def check(changed):
        (saved / CARD).write_text(json.dumps(changed))
        accepted(lambda: decide(saved))

    attack(examples, mutated(json.loads((saved / CARD).read_text())), check)


@EXAMPLES
@pytest.mark.parametrize("name", [CARD, WEIGHTS])
def test_a_damaged_file_is_used_or_refused(name, saved, examples):
    def check(changed):
        (saved / name).write_bytes(changed)
        accepted(lambda: decide(saved))

    attack(examples, damaged((saved / name).read_bytes()), check)
