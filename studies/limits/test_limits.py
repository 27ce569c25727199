"""Steps of information with gains that add up."""

import json

import numpy as np
import pytest

from agents import find_decider, run_command, sweep, task_of
from studies.limits import literature
from studies.limits.__main__ import Limits
from studies.limits.study import STEPS, THREE


def test_the_study_says_how_long_it_takes_before_it_starts(capsys, monkeypatch):
    def start(*_):
        raise InterruptedError

    monkeypatch.setattr("studies.limits.__main__.in_parallel", start)
    with pytest.raises(InterruptedError):
        Limits(jobs=4).run()

    assert "about 2 hours on one core, 30 minutes on 4" in capsys.readouterr().out


def test_published_rules_are_compared_at_thresholds_tuned_apart(tmp_path, monkeypatch):
    chosen = [rule for rule in literature.RULES if rule.name == "ate" and rule.reset]
    monkeypatch.setattr(literature, "RULES", chosen)
    monkeypatch.setattr(literature, "ALPHAS", (0.02, 1e-9))
    monkeypatch.setattr(literature, "BETAS", (1e-9, 0.02))
    command = ["--literature", "--quick", "--jobs", "1", "--out", str(tmp_path)]
    # In this process, so that it has the shorter lists.
    monkeypatch.setattr("studies.limits.__main__.in_parallel", run_here)
    assert run_command(Limits, "limits", command) == 0
    equal, apart = json.loads((tmp_path / "limits.json").read_text())["literature"]
    task = task_of(THREE, {"measurement_variance": 0.1})
    decider = find_decider("ate:{},{}".format(*apart["thresholds"]), task.options)
    again = sweep(task, decider, 10, 0, thresholds=(decider.threshold,))

    # A threshold that no likelihood ratio reaches is not chosen.
    assert apart["thresholds"] == [0.02, 0.02]
    reward = float(again.curve(task.statistic("reward"))[0])
    assert apart["reward"]["value"] == pytest.approx(reward)
    assert apart["gain"]["value"] == pytest.approx(reward - equal["reward"]["value"])


def run_here(calls, *_):
    return [function(*arguments) for function, arguments, _ in calls]


@pytest.mark.parametrize("flags", [[], ["--unknown"]])
def test_the_quick_form_writes_its_files(flags, tmp_path, run_study):
    printed = run_study("limits", "--quick", *flags, "--jobs", "1", "--out", str(tmp_path))
    rows = json.loads((tmp_path / "limits.json").read_text())

    assert (tmp_path / "limits.md").read_text() in printed
    rewards = [row["reward"]["value"] for row in rows["steps"]]
    gains = [row["gain"] and row["gain"]["value"] for row in rows["steps"]]
    assert np.diff(rewards) == pytest.approx(gains[1:])
    steps = [row["step"] for row in rows["steps"]]
    if flags:
        assert len(rewards) == 4
        return
    assert steps == list(STEPS)
    *below, bound = rows["bound"][:4]
    assert bound["step"] == "bound"
    for row in below:
        assert row["gain"]["value"] == pytest.approx(
            row["reward"]["value"] - bound["reward"]["value"]
        )
    # The more a bank knows of the anchor, the sooner the MSPRT decides.
    times = [row["time_95"]["value"] for row in rows["rules"] if row["rule"] == "MSPRT"]
    assert times == sorted(times, reverse=True)
