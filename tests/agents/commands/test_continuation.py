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
from baselines.rules import own_modules

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

    def sweep(task, family, *arguments, **keywords):
        names.append(family.name)
        return evaluate(task, family, *arguments, **keywords)

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

    assert (agent / "checkpoint.safetensors").is_file()
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


RULE = "import numpy as np\n{}\ndef rule(rows):\n    return np.full(len(rows), limits.ACTION)\n"
IMPORTS = {
    "known": "import limits",
    "not known": "import importlib\nimport limits\nimportlib.import_module('json')",
}


def forget(*modules):
    """Forget imported modules, as a new process has."""
    for module in modules:
        sys.modules.pop(module, None)
    own_modules._digest_at_import.cache_clear()


@pytest.mark.parametrize("kind", ["file", "module"])
@pytest.mark.parametrize("imported", IMPORTS)
@pytest.mark.parametrize("edited", [True, False])
def test_a_comparison_goes_on_with_the_same_code_only(
    tmp_path,
    monkeypatch,
    swept,
    kind,
    imported,
    edited,
):
    place = tmp_path / "place"
    place.mkdir()
    monkeypatch.chdir(place)
    monkeypatch.setattr(sys, "path", [*sys.path])
    name = f"mine_{imported.replace(' ', '_')}_{edited}"
    (place / f"{name}.py").write_text(RULE.format(IMPORTS[imported]))
    (place / "limits.py").write_text("ACTION = 1\n")
    agents = ("--agents", f"{name}.py:rule" if kind == "file" else f"{name}:rule", "shipped")
    forget(name, "limits")
    interrupt(tmp_path / "out", 3, agents)
    swept.clear()
    if edited:
        (place / "limits.py").write_text("ACTION = 2\n")
    forget(name, "limits")

    assert run(tmp_path / "out", agents) == 0
    assert ("rule" in swept) == (edited or imported == "not known")


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
