"""The search for hyper-parameters: ranges, resuming, equal results in parallel, the recipe that
it writes.
"""

import dataclasses

import numpy as np
import pytest
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from small_training import SCHEME, SMALL_PPO

from agents.cli import main
from agents.training.recipe import load_recipe, recipe_names
from agents.tuning.search import (
    BEST,
    DEFAULT_RANGES,
    POINTS,
    Search,
    changes_of,
    open_study,
    parse_range,
    parse_ranges,
    train_trial,
    values_of,
)
from hybrid_env.checks import ArgumentError

ENV = "hybrid_env:HybridTrackPublished-v0"
RANGES = ("learning_rate=0.001..0.02", "batch_size=160|320", "n_epochs=1..3")
FLAGS = (
    "--env",
    ENV,
    "--steps",
    "1280",
    "--scheme",
    SCHEME["scheme"],
    "--set",
    *SMALL_PPO,
    "--search",
    *RANGES,
)


def tune(folder, trials, *more):
    assert main(["tune", "--out", str(folder), "--trials", str(trials), *more, *FLAGS]) == 0


def found(folder):
    """Parameters, reward and state of every trial of a folder."""
    ranges = dict(map(parse_range, RANGES))
    search = Search(ENV, dict(SCHEME), "ppo", SMALL_PPO, ranges, 0, 1280)
    return [(one.params, one.value, one.state) for one in open_study(search, folder).get_trials()]


def test_a_search_goes_on_and_its_best_trial_is_a_recipe(tmp_path, capsys):
    tune(tmp_path, 2)
    first = found(tmp_path)
    tune(tmp_path, 4, "--jobs", "2")
    trials = found(tmp_path)

    assert trials[:2] == first
    assert len(trials) == 4
    # The recipe itself.
    assert trials[0][0] == {
        "learning_rate": 0.006,
        "batch_size": "320",
        "n_epochs": 2,
    }
    best = max(
        trials,
        key=lambda one: -np.inf if one[1] is None else one[1],
    )
    recipe = load_recipe(str(tmp_path / BEST), ENV)
    assert recipe.settings.n_epochs == best[0]["n_epochs"]
    assert recipe.settings.batch_size == int(best[0]["batch_size"])
    assert float(recipe.settings.learning_rate.removeprefix("lin_")) == pytest.approx(
        best[0]["learning_rate"],
        rel=5e-3,
    )
    assert recipe.settings.policy_kwargs == {"net_arch": [16]}
    assert "Best of 4 trials" in capsys.readouterr().out


def test_two_jobs_find_what_one_finds(tmp_path):
    for jobs in ("1", "2"):
        tune(tmp_path / jobs, 5, "--jobs", jobs)
    assert found(tmp_path / "1") == found(tmp_path / "2")
    assert (tmp_path / "1" / BEST).read_bytes() == (tmp_path / "2" / BEST).read_bytes()


def test_another_search_in_the_folder_is_refused(tmp_path, capsys):
    tune(tmp_path, 1)
    assert main(["tune", "--out", str(tmp_path), "--trials", "1", "--seed", "1", *FLAGS]) == 2
    assert (
        "expected a new folder, or the flags with which its search began" in capsys.readouterr().err
    )


def test_the_trials_of_a_killed_search_are_repeated_with_their_values(tmp_path):
    search = Search(
        ENV,
        dict(SCHEME),
        "ppo",
        SMALL_PPO,
        dict([parse_range("n_epochs=1..3")]),
        0,
        2560,
    )
    study = open_study(search, tmp_path)
    # The recipe itself.
    study.ask()
    trial = study.ask()
    value = trial.suggest_int("n_epochs", 1, 3)
    again = open_study(search, tmp_path)
    # As in the recipe.
    assert again.ask().suggest_int("n_epochs", 1, 3) == 2
    assert again.ask().suggest_int("n_epochs", 1, 3) == value


def test_a_training_below_the_median_ends_early():
    recipe = load_recipe("ppo", ENV, SMALL_PPO)
    search = Search(ENV, dict(SCHEME), "ppo", SMALL_PPO, {}, 0, 12800)
    outcome = train_trial(search, recipe, [9.0] * POINTS)

    assert outcome.reward is None
    assert 5 <= len(outcome.rewards) < POINTS
    whole = train_trial(dataclasses.replace(search, steps=2560), recipe, [-9.0] * POINTS)
    assert len(whole.rewards) == POINTS
    assert whole.reward is not None


@pytest.mark.parametrize("name", recipe_names())
def test_every_recipe_has_ranges_that_it_takes(name):
    unknown = name in ("statements", "rhythm") or name.startswith("q-")
    env_id = "hybrid_env:HybridTrackQuickest-v0" if unknown else ENV
    recipe = load_recipe(name, env_id)
    ranges = parse_ranges((), recipe)

    assert len(ranges) == len(DEFAULT_RANGES[recipe.algo.removeprefix("recurrent_")])
    for values in (
        {name: one.low for name, one in ranges.items()},
        {name: one.high for name, one in ranges.items()},
    ):
        load_recipe(name, env_id, changes_of(values, recipe))
    assert set(values_of(recipe, ranges)) <= set(ranges)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "n_epochs",
        "n_epochs=",
        "n_epochs=1",
        "n_epochs=3..1",
        "n_epochs=1..1",
        "a=1..b",
        "a=1..inf",
        "=1..2",
        "a=1..2..3",
        "a=1|1",
        "a=1|",
    ],
)
def test_an_invalid_range_is_refused(text):
    with pytest.raises(ArgumentError, match=r"search=.* is not allowed: expected name=low\.\.high"):
        parse_range(text)


def test_ranges_are_read():
    assert parse_range("n_epochs=1..10") == ("n_epochs", IntDistribution(1, 10, log=True))
    assert parse_range("gae_lambda=0.8..1") == ("gae_lambda", FloatDistribution(0.8, 1.0))
    assert parse_range("batch_size=1|2") == ("batch_size", CategoricalDistribution(("1", "2")))
    with pytest.raises(ArgumentError, match="different names"):
        parse_ranges(("a=1..2", "a=1|2"), load_recipe("ppo", ENV))


def test_values_that_no_trial_can_use_are_one_line(tmp_path, capsys):
    flags = ["--search", "n_epoch=1..3", "--trials", "2", "--out", str(tmp_path), "--steps", "100"]
    assert main(["tune", *flags, "--set", *SMALL_PPO]) == 2
    assert "no trial could be trained" in capsys.readouterr().err
