"""A comparison that is interrupted and started again gives the results of an uninterrupted one."""

import json
import shlex
import sys

import pytest
from small_training import small_recipe

from agents.cli import main
from agents.commands import comparison
from agents.commands.continuation import TRAINED, UNFINISHED, content_digest
from agents.training.algorithm import Algorithm

LINE = (
    "compare --episodes 4 --selection-episodes 4 --deciders ml fixed --scheme random\\ 2x20-25"
    " --seed 5"
)
NO_AGENTS = ("--agents",)


def run(folder, agents, line=LINE):
    return main([*shlex.split(line), *agents, "--out", str(folder)])


def results(folder):
    return (folder / "compare.json").read_bytes()


@pytest.fixture(scope="module")
def agents(tmp_path_factory):
    """Flags for an agent that is trained in two rounds, and another one."""
    recipe = small_recipe(tmp_path_factory.mktemp("recipe"))
    return "--agents", str(recipe), "shipped", "--steps", "1280"


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory, agents):
    folder = tmp_path_factory.mktemp("whole")
    assert run(folder, agents) == 0
    return folder


@pytest.fixture
def swept(monkeypatch):
    """Names of the deciders that are evaluated."""
    names = []
    evaluate = comparison.sweep

    def sweep(task, decider, *arguments, **keywords):
        names.append(decider.title)
        return evaluate(task, decider, *arguments, **keywords)

    monkeypatch.setattr(comparison, "sweep", sweep)
    return names


def interrupt(folder, after, agents):
    """Run a comparison that is interrupted after a number of deciders."""
    original = comparison.Entry
    entries = []

    def entry(*arguments):
        if len(entries) == after:
            raise KeyboardInterrupt
        entries.append(original(*arguments))
        return entries[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(comparison, "Entry", entry)
        assert run(folder, agents) == 130


def test_a_complete_comparison_leaves_agents_and_no_unfinished_files(uninterrupted):
    assert json.loads(results(uninterrupted))["complete"] is True
    (agent,) = (uninterrupted / TRAINED).iterdir()
    assert agent.name.startswith("small-ppo-seed0-")
    assert (agent / "policy.safetensors").is_file()
    assert not (uninterrupted / UNFINISHED).exists()


def test_an_interrupted_evaluation_goes_on(
    uninterrupted,
    agents,
    tmp_path,
    monkeypatch,
    swept,
    capsys,
):
    interrupt(tmp_path, 2, agents)
    assert "the same command continues" in capsys.readouterr().err
    kept = json.loads(results(tmp_path))
    assert kept["complete"] is False
    assert [entry["name"] for entry in kept["deciders"]] == ["ML at the end", "fixed time"]
    # Selection and report.
    assert swept == ["ML at the end"] * 2 + ["fixed time"] * 2 + ["small-ppo"] * 2
    swept.clear()
    monkeypatch.setattr(Algorithm, "between_updates", lambda self: pytest.fail("trained again"))
    assert run(tmp_path, agents) == 0
    assert swept == ["shipped"] * 2
    assert results(tmp_path) == results(uninterrupted)
    assert not (tmp_path / UNFINISHED).exists()


def test_an_interrupted_training_goes_on(uninterrupted, agents, tmp_path, monkeypatch):
    original = Algorithm.between_updates

    def stop(self):
        original(self)
        if self.num_timesteps:
            self.save()
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Algorithm, "between_updates", stop)
        assert run(tmp_path, agents) == 130
    (agent,) = (tmp_path / TRAINED).iterdir()

    assert (agent / "checkpoint.pt").is_file()
    assert run(tmp_path, agents) == 0
    assert results(tmp_path) == results(uninterrupted)


def test_damaged_or_other_results_are_not_used(tmp_path, swept):
    interrupt(tmp_path, 1, NO_AGENTS)
    swept.clear()
    first, second = sorted((tmp_path / UNFINISHED).iterdir())
    first.write_bytes(first.read_bytes()[:100])
    second.write_bytes(b"")

    assert run(tmp_path, NO_AGENTS) == 0
    assert swept == ["ML at the end"] * 2 + ["fixed time"] * 2
    interrupt(tmp_path, 1, NO_AGENTS)
    swept.clear()
    assert run(tmp_path, NO_AGENTS, LINE.replace("--seed 5", "--seed 6")) == 0
    assert swept == ["ML at the end"] * 2 + ["fixed time"] * 2


def test_the_rule_of_a_user_is_scored_again(tmp_path, monkeypatch, swept):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "mine.py").write_text(
        "def rule(rows):\n    return rows[:, 0].astype(int) * 0 + 1\n"
    )
    agents = ("--agents", "mine.py:rule", "shipped")
    interrupt(tmp_path / "out", 3, agents)
    swept.clear()

    assert run(tmp_path / "out", agents) == 0
    assert "rule" in swept


def test_a_run_folder_that_was_trained_again_is_scored_again(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    for name in ("policy.safetensors", "policy.json"):
        (folder / name).write_text("1")
    for name in (str(folder), f"{folder}:auto"):
        before = content_digest(name, "announced")
        assert before == content_digest(name, "announced")
        for file in ("policy.safetensors", "policy.json"):
            (folder / file).write_text((folder / file).read_text() + "1")
            assert content_digest(name, "announced") not in (None, "", before)

    assert content_digest("ate", "announced") == ""
    assert content_digest(print, "announced") is None
