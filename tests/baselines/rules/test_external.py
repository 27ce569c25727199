"""Deciders that users bring: found by file, module and entry point, swept, and refused in one
line.
"""

import functools
import re
import sys
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from agents.evaluation.registry import find_decider, load_decider
from agents.evaluation.task import sweep
from agents.evaluation.tasks import task_of
from baselines import BeamDecider, SPRTDecider
from baselines.rules import external, rollout
from baselines.rules.external import find_external
from hybrid_env import ArgumentError, WorldOptions

evaluate = functools.partial(rollout.evaluate, env_id="hybrid_env:HybridTrackPublished-v0")

OPTIONS = WorldOptions(scheme="random 2x20-25")
SOURCE = '''
import numpy as np
from baselines.rules.sprt import SPRTDecider
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

class Mine(SPRTDecider):
    name, title = "", "ATE again"

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
    return evaluate(decider, episodes=3, scheme=OPTIONS.scheme)


def test_a_function_in_a_file_is_swept_and_equals_the_same_rule_of_the_package(source):
    decider = find_decider(f"{source}:likeliest:0.01", OPTIONS)
    assert (decider.title, decider.thresholds, decider.default, decider.threshold) == (
        "likeliest",
        (0.1, 0.05, 0.01),
        0.05,
        0.01,
    )
    mine, msprt = played(decider), played(find_decider("msprt:0.01", OPTIONS))
    np.testing.assert_array_equal(mine.decided_mode, msprt.decided_mode)
    np.testing.assert_array_equal(mine.ticks, msprt.ticks)


def test_classes_subclasses_and_objects_are_found(source):
    patient = find_decider(f"{source}:Patient", OPTIONS)
    assert (patient.title, patient.symbol, patient.threshold) == ("patient rule", "ticks", 3)
    assert (played(patient.at(9)).ticks == 9).any()
    mine = find_decider(f"{source}:Mine", OPTIONS)
    assert (mine.title, mine.thresholds) == ("ATE again", SPRTDecider.thresholds)
    ate = find_decider("ate:0.01", OPTIONS)
    np.testing.assert_array_equal(played(mine.at(0.01)).ticks, played(ate).ticks)
    for name in ("Once", "once"):
        once = find_decider(f"{source}:{name}", OPTIONS)
        assert (once.thresholds, once.symbol) == ((0.0,), "")
        assert (played(once).ticks == 1).all()


def test_a_module_and_an_entry_point_are_found(source, monkeypatch):
    source.rename(source.with_name("rules_of_a_package.py"))
    assert find_decider("rules_of_a_package:Patient", OPTIONS).title == "patient rule"
    point = EntryPoint("patient", "rules_of_a_package:Patient", external.ENTRY_POINTS)
    monkeypatch.setattr(
        external,
        "entry_points",
        lambda group: [point] if group == external.ENTRY_POINTS else [],
    )
    assert find_decider("patient:2", OPTIONS).threshold == 2
    with pytest.raises(ArgumentError, match="'patient'"):
        find_decider("nobody", OPTIONS)


def test_files_have_the_helpers_beside_them_in_their_present_version(tmp_path):
    """Helpers of the same name in two folders stay apart, and an edited one is imported anew."""
    for action in (1, 2, 3):
        folder = tmp_path / str(action % 2)
        folder.mkdir(exist_ok=True)
        (folder / "mine.py").write_text(HELPED)
        (folder / "limits.py").write_text(f"ACTION = {action}\n")
        assert find_external(f"{folder / 'mine.py'}:rule")([0]) == [action]


def fails(rows):
    return rows[:, 999]


def hard(rows):
    raise ArgumentError("said by the rule")


ANSWERS = {
    "two columns": lambda rows: np.zeros((len(rows), 2), int),
    "NaN": lambda rows: np.full(len(rows), np.nan),
    "no declaration": lambda rows: np.full(len(rows), 4),
}


@pytest.mark.parametrize("answer", ANSWERS)
def test_wrong_answers_name_the_rule_file_and_line(answer):
    line = ANSWERS[answer].__code__.co_firstlineno
    with pytest.raises(
        ArgumentError, match=rf"3 integers from 0 to 3 .*test_external.py line {line}"
    ):
        evaluate(ANSWERS[answer], episodes=3)


def test_an_exception_names_the_line_that_raised_it():
    line = fails.__code__.co_firstlineno + 1
    with pytest.raises(
        ArgumentError,
        match=f"decider fails failed in test_external.py line {line}: IndexError",
    ):
        evaluate(fails, episodes=2)
    with pytest.raises(ArgumentError, match=r"^said by the rule$"):
        evaluate(hard, episodes=2)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("mine.py:nothing", "has no attribute 'nothing'"),
        ("other.py:x", "a file that exists"),
        ("mine.py:states", "one for announced switches; this one is for unknown"),
        ("broken.py:x", r"broken.py failed: SyntaxError: .*line 1"),
        ("leaves.py:x", r"leaves.py failed in leaves.py line 1: SystemExit: 3"),
        ("no.such:x", "No module named 'no'"),
        ("mine.py", "mine.py:MyRule"),
    ],
)
def test_what_cannot_be_used_is_one_line(source, name, message):
    (source.parent / "broken.py").write_text("def x(:")
    (source.parent / "leaves.py").write_text("raise SystemExit(3)")
    with pytest.raises(ArgumentError, match=message) as error:
        load_decider(name, OPTIONS)

    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("options", {"measurement_variance": 1e-9}),
        ("options", {"bank": "none"}),
        ("default", "a"),
        ("task", "nothing"),
        ("thresholds", ["a"]),
        ("oracle", "yes"),
    ],
)
def test_an_attribute_that_is_not_allowed_is_one_line(attribute, value):
    def rule(rows, threshold):
        return np.ones(len(rows), np.int64)

    rule.thresholds = (0.1, 0.2)
    setattr(rule, attribute, value)
    with pytest.raises(ArgumentError) as error:
        find_decider(rule, OPTIONS)

    assert "\n" not in str(error.value)
    words = {"task": "this one is for", "options": "options=|bank="}
    assert re.search(words.get(attribute, f"{attribute}="), str(error.value))


def leaves(rows):
    sys.exit(0)


class LeavesWhenItObserves(SPRTDecider):
    observes = "tracks"

    def observe(self, tracks):
        sys.exit()


@pytest.mark.parametrize("model", [leaves, LeavesWhenItObserves])
def test_a_rule_that_ends_the_program_is_one_line(model):
    decider = find_decider(model, OPTIONS)
    with pytest.raises(ArgumentError, match=r"failed in test_external.py line .*: SystemExit"):
        played(decider)


def test_a_rule_that_asks_for_the_oracle_bank_is_marked():
    class Rule(SPRTDecider):
        title = "mine"

    assert not find_decider(Rule, OPTIONS).oracle
    Rule.options = {"bank": "oracle"}
    decider = find_decider(Rule, OPTIONS).at(0.1)
    assert decider.title.endswith(", true anchor")
    assert decider.oracle


def test_a_beam_of_a_user_is_created_at_every_threshold():
    class Beam(BeamDecider):
        title = "mine"

    task = task_of("HybridTrackQuickest-v0", {"ticks": 60})
    thresholds = (0.5, 0.9)
    both = [
        sweep(task, find_decider(model, task.options), 3, 1, thresholds=thresholds).values
        for model in (Beam, "beam")
    ]
    np.testing.assert_array_equal(*both)
