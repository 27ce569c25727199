"""Recipes: read, changed and written; those that are damaged or written to do damage are
refused.
"""

import json

import numpy as np
import pytest
import yaml
from hostile_input import accepted, attack, damaged, mutated

from agents.algorithms.ppo import PPOSettings
from agents.interface.input_files import LARGEST_FILE
from agents.training.recipe import FOLDER, Recipe, load_recipe, recipe_names, recipe_of
from agents.training.runs import make_run
from hybrid_env.checks import ArgumentError

ENV = "hybrid_env:HybridTrackPublished-v0"
SMALL = load_recipe(
    "ppo",
    ENV,
    ("n_envs=16", "n_steps=32", "batch_size=256", "policy_kwargs.net_arch=[16]"),
)
STUDY = pytest.param(5_000, marks=pytest.mark.study)
LAUGHS = "a: &a [x, x]\nb: &b [*a, *a, *a, *a, *a]\n" + "".join(
    f"{chr(c + 1)}: &{chr(c + 1)} [{', '.join(['*' + chr(c)] * 9)}]\n"
    for c in range(ord("b"), ord("l"))
)


INVALID = {
    "ppo": [
        ("n_envs", -1),
        ("n_steps", 1.5),
        ("batch_size", 0),
        ("batch_size", 10**6),
        ("batch_size", 1),
        ("batch_size", 1000),
        ("n_epochs", 0),
        ("learning_rate", 0.0),
        ("learning_rate", float("nan")),
        ("learning_rate", 2.0),
        ("learning_rate", "log_3"),
        ("gae_lambda", 1.5),
        ("gamma", -1.0),
        ("ent_coef", -1.0),
        ("policy_kwargs", {"net_arch": []}),
        ("policy_kwargs", {"net_arch": [0]}),
        ("wait_bias", float("inf")),
        ("n_timesteps", 0),
        ("n_timesteps", True),
        ("algo", "magic"),
        ("algo", [1]),
        ("unknown", 3),
        ("gamma", True),
        ("policy", "CnnPolicy"),
        ("policy_kwargs", 3),
        ("policy_kwargs", {"net_arch": 3}),
        ("policy_kwargs", {"net_arch": [True]}),
        ("observe", 5),
        ("observe", "posterior"),
        ("observe", [3]),
        ("policy_kwargs", {"log_std_init": float("nan")}),
    ],
    "a2c": [
        ("n_envs", 0),
        ("n_steps", 0),
        ("n_steps", 10**5),
        ("gae_lambda", 0.0),
        ("batch_size", 64),
    ],
    "dqn": [
        ("buffer_size", 10),
        ("buffer_size", 10**7),
        ("batch_size", 10**5),
        ("learning_starts", -1),
        ("train_freq", 0),
        ("gradient_steps", -1),
        ("target_update_interval", 1),
        ("exploration_fraction", 0.0),
        ("exploration_initial_eps", 1.5),
        ("exploration_final_eps", float("nan")),
        ("n_steps", 0),
        ("policy_kwargs", {"n_quantiles": 5}),
        ("policy_kwargs", {"ortho_init": True}),
        ("wait_bias", "5"),
    ],
    "qrdqn": [
        ("policy_kwargs", {"n_quantiles": 10**6}),
        ("policy", "CnnPolicy"),
    ],
    "anchor": [
        ("n_steps", 0),
        ("random_declarations", 1.0),
        ("worlds", [{"n_envs": 0}]),
        ("worlds", [{"tracks": 3}]),
        ("worlds", [{"n_envs": 3, "options": 3}]),
        ("worlds", [{"n_envs": 3, "options": {"bad": 1}}]),
        ("worlds", [{"n_envs": 3, "env": 3}]),
        ("hidden", 1.5),
        ("learning_rate", -1.0),
        ("smallest_alpha", 0.5),
        ("last_tick", 0),
        ("updates_per_world", 0),
        (
            "drawn_worlds",
            [
                {
                    "radii": 0,
                    "worlds": 1,
                    "n_envs": 1,
                }
            ],
        ),
        ("drawn_worlds", [{"radii": 1}]),
        (
            "drawn_worlds",
            [
                {
                    "radii": 900,
                    "worlds": 900,
                    "n_envs": 900,
                }
            ],
        ),
    ],
    "stopping": [
        ("worlds", []),
        ("drawn_worlds", [{"radii": 1}]),
        ("delay_costs", [0.0, 1.0]),
        ("delay_costs", 3),
        ("passes", 0),
        ("batch_size", 0),
        ("hidden", 10**6),
        ("learning_rate", 2.0),
        ("agent", 3),
        ("worlds", [{"n_envs": 10**5}]),
    ],
    "recurrent-ppo": [
        ("policy_kwargs", {"lstm_hidden_size": 10**6}),
        ("policy_kwargs", {"n_lstm_layers": 10**9}),
    ],
    "statements": [
        ("durations", []),
        ("durations", ["normal 3"]),
        ("durations", "uniform 5-20"),
        ("n_envs", 0),
        ("n_envs", 10**6),
        ("variances", [2.0, 1.0]),
        ("variances", [1.0]),
        ("radii", [0.0, 1.0]),
        ("batch_size", 1.5),
        ("n_steps", 0),
        ("hidden", 10**6),
        ("learning_rate", 2.0),
        ("belief_weight", -1.0),
    ],
    "rhythm": [
        ("ticks", 0),
        ("ticks", 1e9),
        ("durations", ["drawn or drawn"]),
    ],
}
NAMED = {
    "policy_kwargs": "net_arch|policy_kwargs|recipe|n_quantiles|lstm",
    "unknown": "hyper-parameter='unknown'",
    "worlds": "n_envs=|worlds=|options=|option=|env=",
    "drawn_worlds": "radii=|drawn_worlds=|n_steps=",
}
"""What is named where it is not the hyper-parameter itself."""


@pytest.mark.parametrize(
    ("recipe", "name", "value"),
    [(recipe, *case) for recipe, cases in INVALID.items() for case in cases],
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
        ("3", "an entry"),
        ("default: {algo: ppo", "expected"),
        (LAUGHS, "aliases"),
        ("default: &a {algo: ppo, policy_kwargs: *a}", "aliases"),
        ("[" * 20_000, "brackets"),
        ("- " * 10_000, "too deeply"),
        ("default: {algo: ppo, n_timesteps: 1e400}", "n_timesteps"),
        ("default: {a: .inf}", "not finite"),
        ("default: {a: .nan}", "not finite"),
        (f"default: {{a: 0x{'f' * 9000}}}", "integer is larger"),
        (f"default: {{a: {'9' * 9000}}}", "digits"),
        ("default: {a: 2001-99-99}", "month"),
        ("default: {a: !!bool x}", "'x'"),
        ("default: {a: !!int ''}", "recipe="),
        ("default: {a: !!timestamp x}", "recipe="),
        ("default: !!python/object:os.system {}", "nstructor"),
        ("#" * (LARGEST_FILE + 1), "larger than"),
        ("default: {algo: ppo, ? [a] : 3}", "unhashable"),
    ],
)
def test_a_file_that_is_no_recipe_is_refused(text, reason, tmp_path):
    path = tmp_path / "recipe.yml"
    path.write_text(text)
    with pytest.raises(ArgumentError, match=reason):
        load(path)

    assert accepted(lambda: load(path)) is None


@pytest.mark.parametrize(
    "name",
    ["/dev/zero", "/dev", "a" * 5000, "", "\0", "../" * 2000],
)
def test_a_path_that_is_no_file_is_refused(name):
    with pytest.raises(ArgumentError, match="recipe="):
        load(name)


@pytest.mark.parametrize("examples", [50, STUDY])
@pytest.mark.parametrize("name", ["ppo", "recurrent-ppo", "qrdqn", "anchor-all", "statements"])
def test_a_recipe_with_one_changed_value_is_used_or_refused(name, examples, tmp_path):
    path = tmp_path / "recipe.yml"

    def check(changed):
        path.write_text(yaml.dump(changed))
        accepted(lambda: load(path))

    attack(examples, mutated(yaml.safe_load((FOLDER / f"{name}.yml").read_text())), check)


@pytest.mark.parametrize("examples", [50, STUDY])
@pytest.mark.parametrize("name", ["ppo", "anchor-all"])
def test_a_damaged_recipe_is_used_or_refused(name, examples, tmp_path):
    path = tmp_path / "recipe.yml"

    def check(changed):
        path.write_bytes(changed)
        accepted(lambda: load(path))

    attack(examples, damaged((FOLDER / f"{name}.yml").read_bytes()), check)


@pytest.mark.parametrize("name", recipe_names())
def test_the_recipes_of_the_package_are_used(name):
    assert load(name).name == name


def test_objects_that_move_otherwise_than_told_are_for_agents_that_read_rows_of_plain_noise(
    tmp_path,
):
    recipe = load_recipe(
        "robust",
        "HybridTrackQuickest-v0",
        ("inexact=2", "n_envs=2", "batch_size=4", "ticks=20"),
    )
    run = make_run("HybridTrackQuickest-v0", {}, recipe, 0, tmp_path / "run", 80)
    [batch] = run.batches()

    assert batch.inputs.shape == (20, 4, 2, 26)
    assert np.isfinite(batch.inputs.numpy()).all()
    with pytest.raises(ArgumentError, match=r"missed=0.1 .*the default with the setting inexact"):
        make_run("HybridTrackQuickest-v0", {"missed": 0.1}, recipe, 0, tmp_path / "other", 80)
    with pytest.raises(ArgumentError, match=r"durations=.*a list of 1 to"):
        load_recipe("robust", "HybridTrackQuickest-v0", ("inexact=0",))
    rhythm = load_recipe("rhythm", "HybridTrackQuickest-v0", ("inexact=1",))
    with pytest.raises(ArgumentError, match=r"inexact=1 .*does not read rows"):
        make_run("HybridTrackQuickest-v0", {}, rhythm, 0, tmp_path / "third", 80)
