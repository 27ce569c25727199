"""The search for hyper-parameters: ranges, resuming, equal results in parallel, the recipe that
it writes.
"""

import numpy as np
import pytest
import yaml
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

from agents import load_recipe, run_command
from hybrid_env import ArgumentError
from studies.tuning.__main__ import Tune
from studies.tuning.search import (
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

ENV = "hybrid_env:HybridTrackPublished-v0"
OPTIONS = {"scheme": "random 2x20-30"}
SMALL = ("n_envs=20", "n_steps=32", "batch_size=320", "n_epochs=2", "policy_kwargs.net_arch=[16]")
RANGES = ("learning_rate=0.001..0.02", "batch_size=160|320", "n_epochs=1..3")


def tune(folder, trials, jobs=1):
    flags = ["--env", ENV, "--options", yaml.safe_dump(OPTIONS), "--steps", "1280", "--set", *SMALL]
    flags += ["--search", *RANGES, "--out", str(folder), "--trials", str(trials)]
    assert run_command(Tune, "tune", [*flags, "--jobs", str(jobs)]) == 0


def trials_of(folder):
    """Parameters, reward and state of every trial of a folder."""
    ranges = dict(map(parse_range, RANGES))
    search = Search(ENV, OPTIONS, "ppo", SMALL, ranges, 0, 1280)
    trials = open_study(search, folder).get_trials()
    return [(trial.params, trial.value, trial.state) for trial in trials]


def test_a_search_goes_on_in_other_processes_and_its_best_trial_is_a_recipe(tmp_path, capsys):
    tune(tmp_path, 2)
    first = trials_of(tmp_path)
    tune(tmp_path, 4, jobs=2)
    trials = trials_of(tmp_path)

    assert trials[:2] == first
    assert len(trials) == 4
    # The recipe itself.
    assert trials[0][0] == {"learning_rate": 0.006, "batch_size": "320", "n_epochs": 2}
    best = max(trials, key=lambda trial: -np.inf if trial[1] is None else trial[1])[0]
    settings = load_recipe(str(tmp_path / BEST), ENV).settings
    assert settings.n_epochs == best["n_epochs"]
    assert settings.batch_size == int(best["batch_size"])
    rate = float(settings.learning_rate.removeprefix("lin_"))
    assert rate == pytest.approx(best["learning_rate"], rel=5e-3)
    assert "Best of 4 trials" in capsys.readouterr().out


def test_the_trials_of_a_killed_search_are_repeated_with_their_values(tmp_path):
    ranges = dict([parse_range("n_epochs=1..3")])
    search = Search(ENV, OPTIONS, "ppo", SMALL, ranges, 0, 2560)
    study = open_study(search, tmp_path)
    # The recipe itself.
    study.ask()
    value = study.ask().suggest_int("n_epochs", 1, 3)
    again = open_study(search, tmp_path)
    # As in the recipe.
    assert again.ask().suggest_int("n_epochs", 1, 3) == 2
    assert again.ask().suggest_int("n_epochs", 1, 3) == value


def test_a_training_below_the_median_ends_early():
    search = Search(ENV, OPTIONS, "ppo", SMALL, {}, 0, 12800)
    outcome = train_trial(search, SMALL, [9.0] * POINTS)

    assert outcome.reward is None
    assert 5 <= len(outcome.rewards) < POINTS


@pytest.mark.parametrize("name", sorted({*DEFAULT_RANGES} - {"flights", "gliders"}))
def test_every_recipe_has_ranges_that_it_takes(name):
    env_id = "hybrid_env:HybridTrackQuickest-v0" if name in ("statements", "rhythm") else ENV
    entry = load_recipe(name, env_id).as_json()["entry"]
    ranges = parse_ranges((), name)

    for values in (
        {name: values.low for name, values in ranges.items()},
        {name: values.high for name, values in ranges.items()},
    ):
        load_recipe(name, env_id, changes_of(values, entry))
    assert set(values_of(entry, ranges)) <= set(ranges)


def test_ranges_are_read():
    assert parse_range("n_epochs=1..10") == ("n_epochs", IntDistribution(1, 10, log=True))
    assert parse_range("gae_lambda=0.8..1") == ("gae_lambda", FloatDistribution(0.8, 1.0))
    assert parse_range("batch_size=1|2") == ("batch_size", CategoricalDistribution(("1", "2")))
    for text in ("", "n_epochs=1", "n_epochs=3..1", "a=1..inf", "a=1|1"):
        with pytest.raises(ArgumentError, match="search="):
            parse_range(text)
