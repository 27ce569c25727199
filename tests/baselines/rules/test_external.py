"""Deciders of a user: found by file, module and entry point, and swept."""

import contextlib
import functools
import sys
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from agents.evaluation.registry import find_decider, load_decider
from baselines.rules import external, rollout
from baselines.rules.external import find_external
from hybrid_env import ArgumentError, WorldOptions

record_decisions = functools.partial(
    rollout.record_decisions, env_id="hybrid_env:HybridTrackPublished-v0"
)

OPTIONS = WorldOptions(scheme="random 2x20-25")
SOURCE = '''
import numpy as np
from hybrid_env.observation import Layout

def likeliest(rows, error=0.05):
    """The MSPRT with equal priors, in numbers."""
    ratios = np.exp(Layout.of_rows(rows).read(rows, "log_ratio"))
    posterior = ratios / ratios.sum(1, keepdims=True)
    return np.where(1 - posterior.max(1) <= error, posterior.argmax(1) + 1, 0)

likeliest.thresholds = (0.1, 0.05, 0.01)

class Patient:
    title, symbol, default = "patient rule", "ticks", 3
    thresholds = (2, 3, 9)
    def __init__(self, ticks):
        self.ticks = ticks
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        waited = np.where(episode_start, 0, 0 if state is None else state) + 1
        return np.where(waited % self.ticks == 0, 1, 0), waited

class Once:
    def __call__(self, rows):
        return np.ones(len(rows), int)

once = Once()
states = lambda rows: np.zeros(len(rows), int)
states.task = "unknown"
'''


HELPED = "from limits import ACTION\ndef rule(rows):\n    return [ACTION] * len(rows)\n"


@pytest.fixture
def source(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    path = tmp_path / "mine.py"
    path.write_text(SOURCE)
    return path


def played(decider):
    return record_decisions(decider, episodes=3, scheme=OPTIONS.scheme)


def test_a_function_in_a_file_is_swept_and_equals_the_same_rule_of_the_package(source):
    decider = find_decider(f"{source}:likeliest:0.01", OPTIONS)
    assert (decider.default, decider.threshold) == (0.05, 0.01)
    mine, msprt = played(decider), played(find_decider("msprt:0.01", OPTIONS))
    np.testing.assert_array_equal(mine.decided_mode, msprt.decided_mode)
    np.testing.assert_array_equal(mine.ticks, msprt.ticks)


def test_classes_and_objects_are_found(source):
    patient = find_decider(f"{source}:Patient", OPTIONS)
    assert patient.threshold == 3
    assert (played(patient.at(9)).ticks == 9).any()
    for name in ("Once", "once"):
        once = find_decider(f"{source}:{name}", OPTIONS)
        assert (played(once).ticks == 1).all()


def test_a_module_and_an_entry_point_are_found(source, monkeypatch):
    source.rename(source.with_name("rules_of_a_package.py"))
    assert find_decider("rules_of_a_package:Patient", OPTIONS).title == "patient rule"
    point = EntryPoint("patient", "rules_of_a_package:Patient", "hybridtrack.deciders")
    monkeypatch.setattr(
        external, "entry_points", lambda group: [point] if group == "hybridtrack.deciders" else []
    )
    assert find_decider("patient:2", OPTIONS).threshold == 2
    with pytest.raises(ArgumentError, match="did you mean 'patient'"):
        find_decider("patiens", OPTIONS)


@pytest.mark.parametrize(
    "name", ["mine:once", "mine.py:once", "policy.onnx", "model.zip", "model.zip:once", "xyz"]
)
def test_modules_of_the_present_folder_are_found_by_their_name_alone(source, name):
    """What a library looks for later would be code of a folder that is only visited."""
    (source.parent / "model.py").write_text("raise SystemExit(3)")
    (source.parent / "model.zip").write_bytes(b"")
    with contextlib.suppress(ArgumentError):
        find_decider(name, OPTIONS)

    assert str(source.parent) not in sys.path
    assert "model" not in sys.modules


def test_files_have_the_helpers_beside_them_in_their_present_version(tmp_path):
    """Helpers of the same name in two folders stay apart, and an edited one is imported anew."""
    for action in (1, 2, 3):
        folder = tmp_path / str(action % 2)
        folder.mkdir(exist_ok=True)
        (folder / "mine.py").write_text(HELPED)
        (folder / "limits.py").write_text(f"ACTION = {action}\n")
        assert find_external(f"{folder / 'mine.py'}:rule")([0]) == [action]


LISTED = "NAME with one of its functions or classes: likeliest, Patient, Once, once, states"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("mine.py:states", "one for announced switches; this one is for unknown"),
        ("leaves.py:x", r"leaves.py failed in leaves.py line 1: SystemExit: 3"),
        ("ends.py:x", "ends.py failed in ends.py line 1: GeneratorExit: 3"),
        ("mine.py", f"mine.py:{LISTED}"),
        ("mine.py:nosuch", f"mine.py:{LISTED}"),
        ("nosuch.py", "nosuch.py' is not allowed: expected a file that exists"),
    ],
)
def test_what_cannot_be_used_is_refused(source, name, message):
    (source.parent / "leaves.py").write_text("raise SystemExit(3)")
    (source.parent / "ends.py").write_text("raise GeneratorExit(3)")
    with pytest.raises(ArgumentError, match=message):
        load_decider(name, OPTIONS)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (GeneratorExit, "decider Ends failed in test_external.py line [0-9]+: GeneratorExit"),
        (BaseException, "decider Ends failed in test_external.py line [0-9]+: BaseException"),
    ],
)
def test_a_rule_cannot_end_the_program(kind, message):
    class Ends:
        def predict(self, rows, **unused):
            raise kind

    with pytest.raises(ArgumentError, match=message):
        record_decisions(Ends(), episodes=1)


def test_wrong_answers_are_refused():
    with pytest.raises(ArgumentError, match="3 integers from 0 to 3"):
        record_decisions(lambda rows: np.full(3, 4), episodes=3)
