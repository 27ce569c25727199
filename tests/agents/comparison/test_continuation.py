"""A comparison that is interrupted and started again gives the results of an uninterrupted one."""

import json

import pytest
from agents.comparison import study
from agents.comparison.continuation import TRAINED, UNFINISHED

from agents.cli import main
from agents.training.run import Run

LINE = (
    "compare --episodes 12 --selection-episodes 12 --deciders ate msprt --agents ppo shipped --steps 16384 "
    "--scheme random\\ 2x20-25 --seed 5 --out"
)


def run(folder, line=LINE):
    import shlex

    return main([*shlex.split(line), str(folder)])


def results(folder):
    return (folder / "compare.json").read_bytes()


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    assert run(folder) == 0
    return folder


@pytest.fixture
def swept(monkeypatch):
    """Names of the deciders that are evaluated."""
    names = []
    evaluate = study._sweep

    def sweep(family, *arguments, **keywords):
        names.append(family.name)
        return evaluate(family, *arguments, **keywords)

    monkeypatch.setattr(study, "_sweep", sweep)
    return names


def interrupt_evaluation(monkeypatch, after):
    """Interrupt after a number of deciders."""
    original, count = study._entry, 0

    def entry(*arguments):
        nonlocal count
        count += 1
        if count > after:
            raise KeyboardInterrupt
        return original(*arguments)

    patch = pytest.MonkeyPatch()
    patch.setattr(study, "_entry", entry)
    return patch


def test_a_complete_comparison_leaves_agents_and_no_unfinished_files(uninterrupted):
    assert json.loads(results(uninterrupted))["complete"] is True
    (agent,) = (uninterrupted / TRAINED).iterdir()
    assert agent.name.startswith("ppo-seed0-")
    assert (agent / "policy.safetensors").is_file()
    assert not (uninterrupted / UNFINISHED).exists()


def test_an_interrupted_evaluation_goes_on(uninterrupted, tmp_path, monkeypatch, swept, capsys):
    patch = interrupt_evaluation(monkeypatch, after=2)
    assert run(tmp_path) == 130
    patch.undo()
    assert "the same command goes on" in capsys.readouterr().err
    kept = json.loads(results(tmp_path))
    assert kept["complete"] is False
    assert [entry["name"] for entry in kept["deciders"]] == ["ATE (SPRT)", "MSPRT"]
    assert swept == ["ATE (SPRT)", "MSPRT", "ppo"]
    swept.clear()
    monkeypatch.setattr(Run, "between_updates", lambda self: pytest.fail("trained again"))
    assert run(tmp_path) == 0
    assert swept == ["shipped"]
    assert results(tmp_path) == results(uninterrupted)
    assert not (tmp_path / UNFINISHED).exists()


def test_an_interrupted_training_goes_on(uninterrupted, tmp_path, monkeypatch):
    original = Run.between_updates

    def interrupt(self):
        original(self)
        if self.num_timesteps:
            self.save()
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Run, "between_updates", interrupt)
        assert run(tmp_path) == 130
    (agent,) = (tmp_path / TRAINED).iterdir()
    assert (agent / "checkpoint.safetensors").is_file()
    assert run(tmp_path) == 0
    assert results(tmp_path) == results(uninterrupted)


def test_damaged_or_other_results_are_not_used(tmp_path, monkeypatch, swept):
    line = LINE.replace("--agents ppo shipped --steps 16384", "--agents")
    patch = interrupt_evaluation(monkeypatch, after=1)
    assert run(tmp_path, line) == 130
    patch.undo()
    swept.clear()
    first, second = sorted((tmp_path / UNFINISHED).iterdir())
    first.write_bytes(first.read_bytes()[:100])
    second.write_bytes(b"")
    assert run(tmp_path, line) == 0
    assert swept == ["ATE (SPRT)", "MSPRT"]
    patch = interrupt_evaluation(monkeypatch, after=1)
    assert run(tmp_path, line) == 130
    patch.undo()
    swept.clear()
    assert run(tmp_path, line.replace("--seed 5", "--seed 6")) == 0
    assert swept == ["ATE (SPRT)", "MSPRT"]
