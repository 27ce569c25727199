"""The search for hyper-parameters: ranges, resuming, equal results in parallel, the recipe that
it writes.
"""

import numpy as np
import pytest

from agents import load_recipe, run_command
from studies.tuning.__main__ import Tune
from studies.tuning.search import POINTS, Search, open_study, parse_range, train_trial

ENV = "hybrid_env:HybridTrackPublished-v0"
SMALL = ("n_envs=20", "n_steps=32", "batch_size=320", "n_epochs=2", "policy_kwargs.net_arch=[16]")
RANGES = ("learning_rate=0.001..0.02", "batch_size=160|320", "n_epochs=1..3")


def tune(folder, trials, jobs):
    """Parameters and reward of the trials of a search, after it went on."""
    flags = ["--env", ENV, "--steps", "1280", "--set", *SMALL]
    flags += ["--search", *RANGES, "--out", str(folder), "--trials", str(trials)]
    assert run_command(Tune, "tune", [*flags, "--jobs", str(jobs)]) == 0
    search = Search(ENV, "ppo", SMALL, dict(map(parse_range, RANGES)), 0, 1280)
    return [(trial.params, trial.value) for trial in open_study(search, folder).get_trials()]


def test_a_search_goes_on_in_other_processes_and_its_best_trial_is_a_recipe(tmp_path, capsys):
    first = tune(tmp_path, 2, 1)
    trials = tune(tmp_path, 4, 2)

    assert trials[:2] == first
    assert len(trials) == 4
    # The recipe itself.
    assert trials[0][0] == {"learning_rate": 0.006, "batch_size": "320", "n_epochs": 2}
    best = max(trials, key=lambda trial: -np.inf if trial[1] is None else trial[1])[0]
    settings = load_recipe(str(tmp_path / "best.yml"), ENV).settings
    assert settings.n_epochs == best["n_epochs"]
    rate = float(settings.learning_rate.removeprefix("lin_"))
    assert rate == pytest.approx(best["learning_rate"], rel=5e-3)
    assert "Best of 4 trials" in capsys.readouterr().out


def test_the_trials_of_a_killed_search_are_repeated_with_their_values(tmp_path):
    search = Search(ENV, "ppo", SMALL, dict([parse_range("n_epochs=1..3")]), 0, 2560)
    study = open_study(search, tmp_path)
    values = [study.ask().suggest_int("n_epochs", 1, 3) for _ in range(2)]
    again = open_study(search, tmp_path)
    assert [again.ask().suggest_int("n_epochs", 1, 3) for _ in range(2)] == values
    # The recipe itself.
    assert values[0] == 2


def test_a_training_below_the_median_ends_early():
    rewards, reward, _ = train_trial(Search(ENV, "ppo", SMALL, {}, 0, 12800), {}, [9.0] * POINTS)

    assert reward is None
    assert 5 <= len(rewards) < POINTS
