"""The id whose episodes draw the motion: disjoint episodes, selection and report."""

import numpy as np
import pytest

from agents import find_decider, sweep, task_of
from studies.road import study


def test_selection_training_and_report_have_no_episode_in_common(monkeypatch):
    used = []

    def seeds(task, decider, episodes, seed, **options):
        used.append((seed, seed + episodes))
        return sweep(task, decider, 2, seed, **options)

    monkeypatch.setattr(study, "sweep", seeds)
    monkeypatch.setattr(study, "LEVELS", 2)
    study.selected(study.ROAD, "msprt-type", [{}], 1000)
    study.scores_of((study.ROAD, "at-once", {}, 1.0), 100_000)
    study.told(study.ROAD, "at-once", 100_000, 1000)
    selection, report, *told = used

    assert report[1] <= selection[0] < selection[1] <= study.TRAINING
    for first, last in told:
        begin, end = report if first < selection[0] else selection
        assert begin <= first < last <= end


@pytest.mark.parametrize("env", [study.ROAD, study.UNKNOWN])
def test_the_bank_of_the_id_is_among_those_to_select_from(env):
    options = task_of(env).options

    assert env == study.UNKNOWN or options.radii in study.RADII
    assert options.process_variance in study.PROCESS
    assert str(options.likelihood) in study.LIKELIHOODS[env]


@pytest.mark.parametrize("env", [study.ROAD, study.UNKNOWN])
def test_deciders_that_are_told_read_the_process_noise_of_the_object(env):
    tasks = [task.options for task in study.told_tasks(env)]
    drawn = task_of(env).options

    variances = [options.object_variance for options in tasks]
    assert variances == [options.process_variance for options in tasks] == sorted(variances)
    assert drawn.object_variances[0] < min(variances) < max(variances) < drawn.object_variances[1]
    logs = np.log(drawn.object_variances)
    assert np.mean(np.log(variances)) == pytest.approx(logs.mean())


def test_a_rule_with_selected_options_is_the_best_of_them_in_selection():
    banks = [{"process_variance": variance} for variance in (0.001, 0.01)]
    rewards, settings = zip(*study.selected(study.ROAD, "msprt-type", banks, 20), strict=True)
    task = task_of(study.ROAD, banks[1])
    decider = find_decider("msprt-type", task.options).at(settings[1][-1])
    scores = sweep(task, decider, 20, study.SELECTION, thresholds=(decider.threshold,))

    assert rewards[1] == scores.curve(task.statistic("reward"))[0]


def test_the_robust_agent_earns_more_than_the_shipped_one():
    task = task_of(study.ROAD)
    robust, shipped = (
        sweep(task, find_decider(name, task.options), 200, study.SELECTION, thresholds=(0.0,))
        for name in ("robust", "shipped")
    )

    assert robust.difference(shipped, task.statistic("reward"), 0, 0).low > 0.0


def test_environments_around_the_id_have_a_table(quick_study):
    printed, worlds = quick_study("road", "robust", "--worlds", file="worlds")

    assert list(worlds) == list(study.WORLDS)
    for name, rows in worlds.items():
        assert [row["decider"] for row in rows] == ["at-once", "msprt-type", *2 * ["robust"]]
        assert max(row["difference"]["value"] for row in rows[:2]) == 0.0
        assert study.WORLDS[name].keys() <= rows[0].keys()
        assert printed.count(f"| {name} | ") == 1


@pytest.mark.parametrize(
    ("env", "rules"),
    [(study.ROAD, ["at-once", "msprt-type"]), (study.UNKNOWN, ["threshold", "steady"])],
)
def test_the_quick_form_compares_agents_and_rules(env, rules, quick_study):
    _, rows = quick_study("road", "robust", "--env", env)

    assert [row["decider"] for row in rows] == [*rules, "robust"]
    assert max(row["difference"]["value"] for row in rows[:2]) == 0.0
