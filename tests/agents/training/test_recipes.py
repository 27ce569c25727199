"""Recipes: read, changed and written; those that are damaged or written to do damage are
refused.
"""

import json

import pytest

from agents.training.recipe import load_recipe, package_recipes, recipe_of
from hybrid_env.checks import ArgumentError

ENV = "hybrid_env:HybridTrackPublished-v0"
SMALL = load_recipe(
    "ppo", ENV, ("n_envs=16", "n_steps=32", "batch_size=256", "policy_kwargs.net_arch=[16]")
)
INVALID = [
    ("ppo", "batch_size", 1000),
    ("ppo", "unknown", 3),
    ("recurrent-ppo", "policy_kwargs", {"n_lstm_layers": 10**9}),
]


@pytest.mark.parametrize(("recipe", "name", "value"), INVALID)
def test_invalid_settings_are_refused_in_one_line_that_names_them(recipe, name, value):
    entry = load_recipe(recipe, ENV).as_json()["entry"] | {name: value}
    with pytest.raises(ArgumentError, match="expected") as caught:
        recipe_of("mine", entry)

    assert "\n" not in str(caught.value)


def test_recipes_are_read_changed_written_and_read_again(tmp_path):
    assert SMALL.settings.n_envs == 16
    path = tmp_path / "mine.yml"
    entry = {name: value for name, value in SMALL.as_json()["entry"].items() if name != "n_epochs"}
    path.write_text(
        json.dumps(
            {"HybridTrackPublished-v0": entry | {"n_epochs": 3}, "default": entry | {"n_epochs": 5}}
        )
    )
    assert load_recipe(str(path), ENV).settings.n_epochs == 3
    assert load_recipe(str(path), "hybrid_env:HybridTrackPublishedBank-v0").settings.n_epochs == 5


def test_the_recipes_of_the_package_are_read_written_and_read_again():
    for name in package_recipes():
        recipe = load_recipe(name, ENV)
        again = json.loads(json.dumps(recipe.as_json()))
        assert recipe_of(again["name"], again["entry"]).as_json() == recipe.as_json()
