"""Settings of every algorithm refuse what they do not declare."""

import pytest
from declared import refuse_beyond

from agents.learned.algorithm_names import algorithm_names, find_algorithm
from agents.training.recipe import load_recipe, package_recipes


@pytest.mark.parametrize("algo", algorithm_names())
def test_settings_beyond_the_declared_ones_are_refused_in_one_line_that_names_them(algo):
    recipes = [load_recipe(name, "HybridTrack-v0") for name in package_recipes()]
    given = next(recipe.settings for recipe in recipes if recipe.algo == algo)

    assert refuse_beyond(find_algorithm(algo).Settings, **vars(given)) > 30
