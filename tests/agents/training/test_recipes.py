"""Recipes: read, changed and written; invalid hyper-parameters are refused in one line."""

import json

import pytest

from agents.training.recipe import Recipe, load_recipe, recipe_of
from agents.training.settings import PPOSettings
from hybrid_env.checks import ArgumentError

ENV = "hybrid_env:HybridTrack-v0"
SMALL = load_recipe("ppo", ENV, ("n_envs=16", "n_steps=32", "batch_size=256", "policy_kwargs.net_arch=[16]"))

INVALID = {
    "ppo": [
        ("n_envs", -1), ("n_steps", 1.5), ("batch_size", 0), ("batch_size", 10**6), ("batch_size", 1),
        ("batch_size", 1000), ("n_epochs", 0), ("learning_rate", 0.0), ("learning_rate", float("nan")),
        ("learning_rate", 2.0), ("learning_rate", "log_3"), ("gae_lambda", 1.5), ("gamma", -1.0),
        ("ent_coef", -1.0), ("policy_kwargs", {"net_arch": []}), ("policy_kwargs", {"net_arch": [0]}),
        ("wait_bias", float("inf")), ("n_timesteps", 0), ("n_timesteps", True), ("algo", "magic"),
        ("algo", [1]), ("unknown", 3), ("gamma", True), ("policy", "CnnPolicy"), ("policy_kwargs", 3),
        ("policy_kwargs", {"net_arch": 3}), ("policy_kwargs", {"net_arch": [True]}), ("observe", 5),
        ("observe", "posterior"), ("observe", [3]), ("policy_kwargs", {"log_std_init": float("nan")}),
    ],
    "anchor": [
        ("n_steps", 0), ("random_declarations", 1.0), ("worlds", [{"n_envs": 0}]),
        ("worlds", [{"tracks": 3}]), ("worlds", [{"n_envs": 3, "options": 3}]),
        ("worlds", [{"n_envs": 3, "options": {"bad": 1}}]), ("worlds", [{"n_envs": 3, "env": 3}]),
        ("hidden", 1.5), ("learning_rate", -1.0), ("smallest_alpha", 0.5), ("last_tick", 0),
        ("updates_per_world", 0), ("drawn_worlds", [{"radii": 0, "worlds": 1, "n_envs": 1}]),
        ("drawn_worlds", [{"radii": 1}]), ("drawn_worlds", [{"radii": 900, "worlds": 900, "n_envs": 900}]),
    ],
    "statements": [
        ("durations", []), ("durations", ["normal 3"]), ("durations", "uniform 5-20"), ("n_envs", 0),
        ("n_envs", 10**6), ("variances", [2.0, 1.0]), ("variances", [1.0]), ("radii", [0.0, 1.0]),
        ("batch_size", 1.5), ("n_steps", 0), ("hidden", 10**6), ("learning_rate", 2.0),
        ("belief_weight", -1.0),
    ],
    "flights": [
        ("flights", 3), ("flights", [1, 1, 1]), ("flights", [1, 1, 1, 0]), ("flights", [10**5] * 4),
        ("rows", 0), ("rows", 1e3), ("passes", 0), ("change_cost", -1.0), ("change_cost", 1e9),
        ("n_steps", 0), ("belief_weight", float("nan")),
    ],
}  # fmt: skip
NAMED = {
    "policy_kwargs": "net_arch|policy_kwargs|recipe", "unknown": "hyper-parameter='unknown'",
    "worlds": "n_envs=|worlds=|options=|option=|env=", "drawn_worlds": "radii=|drawn_worlds=|n_steps=",
}  # fmt: skip
"""What is named where it is not the hyper-parameter itself."""


@pytest.mark.parametrize(
    ("recipe", "name", "value"), [(recipe, *case) for recipe, cases in INVALID.items() for case in cases]
)
def test_invalid_settings_are_refused_in_one_line_that_names_them(recipe, name, value):
    entry = load_recipe(recipe, ENV).as_json()["entry"] | {name: value}
    with pytest.raises(ArgumentError, match=NAMED.get(name, name)) as caught:
        recipe_of("mine", entry)
    assert "expected" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_recipes_are_read_changed_written_and_read_again(tmp_path):
    assert isinstance(SMALL.settings, PPOSettings)
    assert SMALL.settings.n_envs == 16
    assert recipe_of("ppo", json.loads(json.dumps(SMALL.as_json()["entry"]))).settings == SMALL.settings
    path = tmp_path / "mine.yml"
    entry = {name: value for name, value in SMALL.as_json()["entry"].items() if name != "n_epochs"}
    path.write_text(
        json.dumps({"HybridTrack-v0": entry | {"n_epochs": 3}, "default": entry | {"n_epochs": 5}})
    )
    assert isinstance(load_recipe(str(path), ENV), Recipe)
    assert load_recipe(str(path), ENV).settings.n_epochs == 3
    assert load_recipe(str(path), "hybrid_env:HybridTrackBank-v0").settings.n_epochs == 5
    path.write_text(json.dumps({"HybridTrack-v0": entry}))
    for env in (ENV, "hybrid_env:HybridTrackBank-v0"):
        with pytest.raises(ArgumentError, match="recipe="):
            load_recipe(str(path), env)
