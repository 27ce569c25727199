"""Run folders whose config or checkpoint has one value changed are resumed or refused in one
line.
"""

import json

import numpy as np
import pytest
from hostile_input import accepted, attack, counts, damaged, mutated
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from agents.training.checkpoint import CHECKPOINT, PREVIOUS, digest
from agents.training.recipe import load_recipe
from agents.training.run_folder import CONFIG
from agents.training.runs import make_run, resume_run
from hybrid_env import Layout, QuickestLayout, QuickestOptions
from hybrid_env.registration import environment_options

KNOWN_SWITCHES = "hybrid_env:HybridTrackPublished-v0", {"scheme": "random 2x5-8"}
ENVIRONMENTS = {
    "statements": ("hybrid_env:HybridTrackQuickest-v0", {"ticks": 8, "durations": "uniform 2-4"}),
    "rhythm": ("hybrid_env:HybridTrackQuickest-v0", {"ticks": 8}),
}
RECIPES = {
    "ppo": ("n_envs=4", "n_steps=16", "batch_size=32", "policy_kwargs.net_arch=[4]"),
    "anchor": ("n_steps=8", "hidden=4", "worlds=[{n_envs: 4}]"),
    "stopping": ("batch_size=8", "passes=1", "worlds=[{n_envs: 2}]", "drawn_worlds=[]"),
    "statements": (
        "n_envs=2",
        "batch_size=4",
        "n_steps=4",
        "hidden=4",
        "durations=[uniform 2-4, geometric 3]",
    ),
    "dqn": (
        "n_envs=4",
        "train_freq=8",
        "learning_starts=32",
        "buffer_size=64",
        "batch_size=8",
        "policy_kwargs.net_arch=[4]",
    ),
    "rhythm": ("n_envs=2", "batch_size=4", "n_steps=4", "hidden=4", "ticks=8"),
}


def resume(folder):
    """A run that is resumed has a decider that decides."""
    run = resume_run(folder)
    family = run.family("run")
    states = environment_options(run.env_id) is QuickestOptions
    row = QuickestLayout if states else Layout
    widths = {
        "rhythm": row(3).width + 19,
    }
    width = widths.get(run.recipe.algo, row(3).width)
    rows = np.zeros((2, width), np.float32)
    if family.hypotheses in (None, 3):
        assert family.make(family.default).predict(rows, None, np.ones(2, np.bool_))[0].shape == (
            2,
        )
    assert run.num_timesteps >= 0
    return run


@pytest.fixture(params=RECIPES)
def folder(request, tmp_path):
    folder = tmp_path / "run"
    env_id, options = ENVIRONMENTS.get(request.param, KNOWN_SWITCHES)
    make_run(
        env_id,
        options,
        load_recipe(request.param, env_id, RECIPES[request.param]),
        0,
        folder,
        128,
    ).train()
    # Is used if the last one is damaged.
    (folder / PREVIOUS).unlink(missing_ok=True)
    resume(folder)
    return folder


@pytest.mark.parametrize("examples", counts(25, 4_000))
def test_a_config_with_one_changed_value_is_used_or_refused(folder, examples):
    def check(changed):
        (folder / CONFIG).write_text(json.dumps(changed))
        accepted(lambda: resume(folder))

    attack(examples, mutated(json.loads((folder / CONFIG).read_text())), check)


@pytest.mark.parametrize("examples", counts(25, 4_000))
def test_a_checkpoint_with_one_changed_value_is_used_or_refused(folder, examples):
    path = folder / CHECKPOINT
    tensors = load_file(path)
    with safe_open(path, framework="pt") as file:
        values = json.loads(file.metadata()["values"])

    def check(changed):
        text = json.dumps(changed)
        save_file(tensors, path, {"values": text, "sha256": digest(tensors, text)})
        accepted(lambda: resume(folder))

    attack(examples, mutated(values), check)


@pytest.mark.parametrize("examples", counts(20, 4_000))
@pytest.mark.parametrize("name", [CONFIG, CHECKPOINT])
def test_a_damaged_file_is_used_or_refused(folder, name, examples):
    content = (folder / name).read_bytes()

    def check(changed):
        (folder / name).write_bytes(changed)
        accepted(lambda: resume(folder))

    attack(examples, damaged(content), check)
