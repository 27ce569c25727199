"""Recipes: read, changed and written; those that are damaged or written to do damage are
refused.
"""

import json

import numpy as np
import pytest
from hostile_input import accepted

from agents.algorithms.ppo import PPOSettings
from agents.interface.input_files import LARGEST_FILE
from agents.training.recipe import Recipe, load_recipe, recipe_names, recipe_of
from agents.training.runs import make_run
from hybrid_env.checks import ArgumentError

ENV = "hybrid_env:HybridTrackPublished-v0"
SMALL = load_recipe(
    "ppo",
    ENV,
    ("n_envs=16", "n_steps=32", "batch_size=256", "policy_kwargs.net_arch=[16]"),
)
INVALID = [
    ("ppo", "batch_size", 1000),
    ("ppo", "algo", "magic"),
    ("ppo", "unknown", 3),
    ("dqn", "buffer_size", 10),
    ("anchor", "worlds", [{"tracks": 3}]),
    ("recurrent-ppo", "policy_kwargs", {"n_lstm_layers": 10**9}),
    ("rhythm", "durations", ["normal 3"]),
]


@pytest.mark.parametrize(("recipe", "name", "value"), INVALID)
def test_invalid_settings_are_refused_in_one_line_that_names_them(recipe, name, value):
    entry = load_recipe(recipe, ENV).as_json()["entry"] | {name: value}
    with pytest.raises(ArgumentError, match="expected") as caught:
        recipe_of("mine", entry)

    assert "\n" not in str(caught.value)


def test_recipes_are_read_changed_written_and_read_again(tmp_path):
    assert isinstance(SMALL.settings, PPOSettings)
    assert SMALL.settings.n_envs == 16
    assert (
        recipe_of("ppo", json.loads(json.dumps(SMALL.as_json()["entry"]))).settings
        == SMALL.settings
    )
    path = tmp_path / "mine.yml"
    entry = {name: value for name, value in SMALL.as_json()["entry"].items() if name != "n_epochs"}
    path.write_text(
        json.dumps(
            {"HybridTrackPublished-v0": entry | {"n_epochs": 3}, "default": entry | {"n_epochs": 5}}
        )
    )
    assert isinstance(load_recipe(str(path), ENV), Recipe)
    assert load_recipe(str(path), ENV).settings.n_epochs == 3
    assert load_recipe(str(path), "hybrid_env:HybridTrackPublishedBank-v0").settings.n_epochs == 5
    path.write_text(json.dumps({"HybridTrackPublished-v0": entry}))
    for env in (ENV, "hybrid_env:HybridTrackPublishedBank-v0"):
        with pytest.raises(ArgumentError, match="recipe="):
            load_recipe(str(path), env)


def load(path, changes=()):
    """A recipe that is used can be written to the config of a run and read again."""
    recipe = load_recipe(str(path), ENV, changes)
    again = json.loads(json.dumps(recipe.as_json()))
    assert recipe_of(again["name"], again["entry"]).as_json() == recipe.as_json()
    return recipe


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "an entry"),
        ("default: !!python/object:os.system {}", "nstructor"),
        ("#" * (LARGEST_FILE + 1), "larger than"),
    ],
)
def test_a_file_that_is_no_recipe_is_refused(text, reason, tmp_path):
    path = tmp_path / "recipe.yml"
    path.write_text(text)
    with pytest.raises(ArgumentError, match=reason):
        load(path)

    assert accepted(lambda: load(path)) is None


def test_the_recipes_of_the_package_are_used():
    for name in recipe_names():
        assert load(name).name == name


def test_objects_that_move_otherwise_than_told_are_for_agents_that_read_rows_of_plain_noise(
    tmp_path,
):
    recipe = load_recipe(
        "robust",
        "HybridTrackQuickest-v0",
        ("inexact=2", "n_envs=2", "batch_size=4", "ticks=20"),
    )
    run = make_run(
        "HybridTrackQuickest-v0",
        {},
        recipe,
        0,
        tmp_path / "run",
        80,
    )
    [batch] = run.batches()

    assert batch.inputs.shape == (20, 4, 2, 26)
    assert np.isfinite(batch.inputs.numpy()).all()
    with pytest.raises(ArgumentError, match=r"missed=0.1 .*the default with the setting inexact"):
        make_run(
            "HybridTrackQuickest-v0",
            {"missed": 0.1},
            recipe,
            0,
            tmp_path / "other",
            80,
        )
    with pytest.raises(ArgumentError, match=r"durations=.*at least one law"):
        load_recipe("robust", "HybridTrackQuickest-v0", ("inexact=0",))
