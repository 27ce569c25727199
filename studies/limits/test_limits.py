"""Steps of information with gains that add up, and the fixed-lag smoother of the beam."""

import json

import numpy as np
import pytest

from agents import find_decider, run_command, sweep, task_of
from baselines import BeamDecider, record_statements
from hybrid_env import QuickestOptions
from studies.limits import literature
from studies.limits.__main__ import Limits
from studies.limits.smoother import BeamSmoother, BranchTable, carry_past
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
        # Later measurements tell more.
        assert rewards[3:] == sorted(rewards[3:])
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


def test_the_carried_probabilities_are_those_of_forward_and_backward_recursions():
    """A branch is a mode and its age, a state of a Markov chain; likelihoods are drawn for every
    tick and state.
    """
    ticks, modes = 7, 3
    states = ticks * modes
    generator = np.random.default_rng(3)
    hazards = generator.uniform(0.1, 0.9, ticks)
    order = (1.0 - np.eye(modes)) / (modes - 1)
    likelihood = generator.lognormal(0.0, 1.5, (ticks, states))
    # From age and mode to age and mode.
    chain = np.zeros((ticks, modes, ticks, modes))
    for age, hazard in enumerate(hazards):
        chain[age, :, 0] = hazard * order
        if age + 1 < ticks:
            chain[age, :, age + 1] = (1.0 - hazard) * np.eye(modes)
    chain = chain.reshape(states, states)
    age, mode = np.divmod(np.arange(states), modes)
    forward = np.where(age == 0, likelihood[0], 0.0)
    filtered = []
    past = np.zeros((1, states, ticks, modes))
    before = None
    for tick in range(ticks):
        if tick:
            forward = likelihood[tick] * (forward @ chain)
        filtered.append(forward / forward.sum())
        with np.errstate(divide="ignore"):
            log_weights = np.log(filtered[-1])[None]
        # The row of the first segment is 0.
        row = (age < tick).astype(np.int64)
        now = BranchTable(mode[None], age[None] + 1, row[None], log_weights)
        past = carry_past(
            before or now, now, past, np.tile(hazards, (2, 1)), np.zeros(modes, np.int64), order
        )
        before = now
    backward = np.ones(states)
    for lag in range(ticks):
        smoothed = filtered[ticks - 1 - lag] * backward
        expected = smoothed.reshape(ticks, modes).sum(0) / smoothed.sum()
        np.testing.assert_allclose(filtered[-1] @ past[0, :, lag], expected, atol=1e-12)
        backward = chain @ (likelihood[ticks - 1 - lag] * backward)


def test_without_later_ticks_the_posterior_is_that_of_the_beam():
    options = {"durations": "10 + geometric 15", "ticks": 80, "start": "random"}
    smoother = BeamSmoother(BeamDecider(QuickestOptions(**options), 0.0), (0, 10))
    statements = record_statements(smoother, 50, 3, **options)
    now, later = (smoother.posterior(lag) for lag in (0, 10))

    np.testing.assert_array_equal(now.argmax(-1), statements.stated_modes)
    np.testing.assert_allclose(later[-1], now[-1], atol=1e-12)
