"""Settings of every algorithm and arguments of every command refuse what they do not declare."""

import re

import pytest
from declared import beyond, refuse_beyond

from agents.algorithms import algorithm_names, find_algorithm
from agents.cli import COMMANDS, main
from agents.training.recipe import load_recipe, recipe_names
from agents.training.worlds import DrawnWorlds, TrainingWorld
from hybrid_env.checks import declaration, declared_fields


@pytest.mark.parametrize("algo", algorithm_names())
def test_settings_beyond_the_declared_ones_are_refused_in_one_line_that_names_them(algo):
    recipes = [load_recipe(name, "HybridTrack-v0") for name in recipe_names()]
    given = next(recipe.settings for recipe in recipes if recipe.algo == algo)

    assert refuse_beyond(find_algorithm(algo).Settings, **vars(given)) > 30


@pytest.mark.parametrize("kind", [TrainingWorld, DrawnWorlds])
def test_parts_of_settings_likewise(kind):
    given = {"n_envs": 3} if kind is TrainingWorld else {"n_envs": 3, "radii": 3, "worlds": 3}
    assert refuse_beyond(kind, **given) > 5


def numbers(command):
    """Yield the flags of a command with declared limits, and a number beyond the limits."""
    for name, hint in declared_fields(command).items():
        kind = hint
        while hasattr(kind, "__args__") and not declaration(kind)[1]:
            kind = kind.__args__[0]
        if declaration(kind)[0] in (int, float) and declaration(kind)[1]:
            yield name, next(beyond(kind))


@pytest.mark.parametrize("name", COMMANDS)
def test_flags_beyond_the_declared_limits_are_refused_in_one_line_that_names_them(name, capsys):
    flags = list(numbers(COMMANDS[name]))
    assert flags or name == "score"
    for flag, value in flags:
        assert main([name, f"--{flag.replace('_', '-')}", str(value)]) == 2
        captured = capsys.readouterr()
        # A flag of several numbers shows all of them.
        shown = rf"hybridtrack: {flag}=\(?{re.escape(str(value))},?\)? is not allowed: expected"
        assert re.match(shown, captured.err)
        assert captured.err.count("\n") == 1
        assert not captured.out
