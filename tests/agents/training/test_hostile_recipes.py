"""Recipes that were damaged, or written to do damage, are refused in one line."""

import json

import pytest
import yaml
from hostile_input import accepted, damaged, mutated, profile
from hypothesis import given

from agents.interface.input_files import LARGEST_FILE
from agents.training.recipe import FOLDER, load_recipe, recipe_names, recipe_of
from hybrid_env.checks import ArgumentError

ENV = "hybrid_env:HybridTrack-v0"
STUDY = pytest.param(5_000, marks=pytest.mark.study)
LAUGHS = "a: &a [x, x]\nb: &b [*a, *a, *a, *a, *a]\n" + "".join(
    f"{chr(c + 1)}: &{chr(c + 1)} [{', '.join(['*' + chr(c)] * 9)}]\n" for c in range(ord("b"), ord("l"))
)


def load(path, changes=()):
    """A recipe that is used can be written to the config of a run and read again."""
    recipe = load_recipe(str(path), ENV, changes)
    again = json.loads(json.dumps(recipe.as_json()))
    assert recipe_of(again["name"], again["entry"]).as_json() == recipe.as_json()
    return recipe


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "an entry"), ("3", "an entry"), ("default: {algo: ppo", "expected"), (LAUGHS, "aliases"),
        ("default: &a {algo: ppo, policy_kwargs: *a}", "aliases"), ("[" * 20_000, "brackets"),
        ("- " * 10_000, "too deeply"), ("default: {algo: ppo, n_timesteps: 1e400}", "n_timesteps"),
        ("default: {a: .inf}", "not finite"), ("default: {a: .nan}", "not finite"),
        (f"default: {{a: 0x{'f' * 9000}}}", "integer is larger"), (f"default: {{a: {'9' * 9000}}}", "digits"),
        ("default: {a: 2001-99-99}", "month"), ("default: {a: !!bool x}", "'x'"),
        ("default: {a: !!int ''}", "recipe="),
        ("default: {a: !!timestamp x}", "recipe="), ("default: !!python/object:os.system {}", "nstructor"),
        ("#" * (LARGEST_FILE + 1), "larger than"), ("default: {algo: ppo, ? [a] : 3}", "unhashable"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_recipe_is_refused(text, reason, tmp_path):
    path = tmp_path / "recipe.yml"
    path.write_text(text)
    with pytest.raises(ArgumentError, match=reason):
        load(path)
    assert accepted(lambda: load(path)) is None


@pytest.mark.parametrize("name", ["/dev/zero", "/dev", "a" * 5000, "", "\0", "../" * 2000])
def test_a_path_that_is_no_file_is_refused(name):
    with pytest.raises(ArgumentError, match="recipe="):
        load(name)


BOUNDED = {
    "ppo": [
        "n_envs=10000000", "n_steps=10000000", "n_steps=100000", "n_epochs=10000000", "wait_bias=1e30",
        "ent_coef=1e30", "learning_rate=[lin_1]", "learning_rate=1e400", "learning_rate=0x" + "f" * 999,
        "policy_kwargs={net_arch: [1000000]}", "policy_kwargs={optimizer_class: x}", "policy_kwargs=[]",
        "n_timesteps=1" + "0" * 30, "observe=3", "observe=[3]", "a=&a [*a]",
        "policy_kwargs" + ".a" * 5000 + "=1", "n_envs=true", "n_envs=" + "[" * 400,
    ],
    "anchor": [
        "hidden=20000", "n_steps=1000000", "batches=0", "buffer_size=1" + "0" * 12,
        "last_tick=1" + "0" * 15, "worlds=3", "worlds={}",
        "worlds=[{n_envs: 1000000000}]", "worlds=[{n_envs: 1, options: {trace_rows: 1000000000}}]",
        "worlds=[{n_envs: 1, options: [3]}]", "worlds=[{n_envs: 1, options: {scheme: 2001-01-01}}]",
        f"worlds=[{'{n_envs: 1},' * 400}]", "smallest_alpha=1e400", "policy_kwargs={}",
        "drawn_worlds=3", "drawn_worlds=[3]", "drawn_worlds=[{radii: 1, worlds: 1000000, n_envs: 1}]",
        "drawn_worlds=[{radii: 1000000, worlds: 1, n_envs: 1}]", "updates_per_world=0",
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "change"), [(name, change) for name, changes in BOUNDED.items() for change in changes]
)
def test_values_are_bounded(name, change):
    assert accepted(lambda: load(name, [change])) is None


@pytest.mark.parametrize("examples", [50, STUDY])
@pytest.mark.parametrize("name", ["ppo", "recurrent-ppo", "anchor-all", "statements"])
def test_a_recipe_with_one_changed_value_is_used_or_refused(name, examples, tmp_path):
    path = tmp_path / "recipe.yml"

    @profile(examples)
    @given(mutated(yaml.safe_load((FOLDER / f"{name}.yml").read_text())))
    def check(changed):
        path.write_text(yaml.dump(changed))
        accepted(lambda: load(path))

    check()


@pytest.mark.parametrize("examples", [50, STUDY])
@pytest.mark.parametrize("name", ["ppo", "anchor-all"])
def test_a_damaged_recipe_is_used_or_refused(name, examples, tmp_path):
    path = tmp_path / "recipe.yml"

    @profile(examples)
    @given(damaged((FOLDER / f"{name}.yml").read_bytes()))
    def check(changed):
        path.write_bytes(changed)
        accepted(lambda: load(path))

    check()


@pytest.mark.parametrize("name", recipe_names())
def test_the_recipes_of_the_package_are_used(name):
    assert load(name).name == name
