"""Deciders that users bring: found by file, module and entry point, swept, and refused in one
line.
"""

import functools
import re
import sys
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from agents.evaluation.registry import find_decider, find_family, load_decider
from baselines import SPRTDecider
from baselines.rules import own, rollout
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


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(SOURCE)
    return path


def played(family, threshold):
    return evaluate(family.make(threshold), episodes=3, scheme=OPTIONS.scheme)


def test_a_function_in_a_file_is_swept_and_equals_the_same_rule_of_the_package(source):
    family, threshold = find_decider(f"{source}:likeliest:0.01", OPTIONS)
    assert (family.name, family.thresholds, family.default) == (
        "likeliest",
        (0.1, 0.05, 0.01),
        0.05,
    )
    mine = played(family, threshold)
    msprt = played(*find_decider("msprt:0.01", OPTIONS))
    np.testing.assert_array_equal(mine.decided_mode, msprt.decided_mode)
    np.testing.assert_array_equal(mine.ticks, msprt.ticks)


def test_classes_subclasses_and_objects_are_found(source):
    patient, ticks = find_decider(f"{source}:Patient", OPTIONS)
    assert (patient.name, patient.symbol, ticks) == ("patient rule", "ticks", 3)
    assert (played(patient, 9).ticks == 9).any()
    mine = find_family(f"{source}:Mine", OPTIONS)
    assert (mine.name, mine.thresholds) == ("ATE again", SPRTDecider.thresholds)
    np.testing.assert_array_equal(
        played(mine, 0.01).ticks,
        played(*find_decider("ate:0.01", OPTIONS)).ticks,
    )
    for name in ("Once", "once"):
        family = find_family(f"{source}:{name}", OPTIONS)
        assert (family.thresholds, family.symbol) == ((0.0,), "")
        assert (played(family, 0.0).ticks == 1).all()


def test_a_module_and_an_entry_point_are_found(source, monkeypatch):
    source.rename(source.with_name("rules_of_a_package.py"))
    monkeypatch.chdir(source.parent)
    monkeypatch.setattr(sys, "path", [*sys.path])

    assert find_family("rules_of_a_package:Patient", OPTIONS).name == "patient rule"
    point = EntryPoint("patient", "rules_of_a_package:Patient", own.ENTRY_POINTS)
    monkeypatch.setattr(
        own,
        "entry_points",
        lambda group: [point] if group == own.ENTRY_POINTS else [],
    )
    assert find_decider("patient:2", OPTIONS)[1] == 2
    with pytest.raises(ArgumentError, match="'patient'"):
        find_family("nobody", OPTIONS)


def fails(rows):
    return rows[:, 999]


def hard(rows):
    raise ArgumentError("said by the rule")


ANSWERS = {
    "two columns": lambda rows: np.zeros((len(rows), 2), int),
    "too few": lambda rows: np.zeros(1, int),
    "NaN": lambda rows: np.full(len(rows), np.nan),
    "no declaration": lambda rows: np.full(len(rows), 4),
    "negative": lambda rows: np.full(len(rows), -1),
    "ragged": lambda rows: [[1], [1, 2]],
    "nothing": lambda rows: None,
}


@pytest.mark.parametrize("answer", ANSWERS)
def test_wrong_answers_name_the_rule_file_and_line(answer):
    line = ANSWERS[answer].__code__.co_firstlineno
    with pytest.raises(ArgumentError, match=rf"3 integers from 0 to 3 .*test_own.py line {line}"):
        evaluate(ANSWERS[answer], episodes=3)


def test_an_exception_names_the_line_that_raised_it():
    line = fails.__code__.co_firstlineno + 1
    with pytest.raises(
        ArgumentError,
        match=f"decider fails failed in test_own.py line {line}: IndexError",
    ):
        evaluate(fails, episodes=2)
    with pytest.raises(ArgumentError, match=r"^said by the rule$"):
        evaluate(hard, episodes=2)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("mine.py:nothing", "a name that mine.py defines"),
        ("other.py:x", "a file that exists"),
        ("mine.py:states", "one for announced switches; this one is for unknown"),
        ("broken.py:x", r"broken.py failed: SyntaxError: .*line 1"),
        ("leaves.py:x", r"leaves.py failed in leaves.py line 1: SystemExit: 3"),
        ("no.such:x", "No module named 'no'"),
        ("unequal.py:rule", "different numbers in unequal.py:rule"),
        ("unequal.py:text", "thresholds='many' is not allowed|thresholds='m' is not allowed"),
        ("unequal.py:Two", r"unequal.py:Two failed: TypeError"),
        ("mine.py", "mine.py:MyRule"),
    ],
)
def test_what_cannot_be_used_is_one_line(source, monkeypatch, name, message):
    monkeypatch.chdir(source.parent)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (source.parent / "broken.py").write_text("def x(:")
    (source.parent / "leaves.py").write_text("raise SystemExit(3)")
    (source.parent / "unequal.py").write_text(
        "def rule(rows): pass\nrule.thresholds = 1, 1\ndef text(rows): pass\ntext.thresholds ="
        " 'many'\nclass Two:\n    thresholds = 1, 2\n    def predict(self, rows): pass\n"
    )
    with pytest.raises(ArgumentError, match=message) as error:
        load_decider(name, OPTIONS)

    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("options", {"nope": 1}),
        ("options", 5),
        ("options", [("bank", "oracle")]),
        ("options", {"bank": "none"}),
        ("options", {"bank": 3}),
        ("options", {3: 3}),
        ("options", {"measurement_variance": 1e-9}),
        ("options", {"hazard": 0.1}),
        ("title", 5),
        ("title", "two\nlines"),
        ("symbol", 5),
        ("default", "a"),
        ("default", 7),
        ("default", float("nan")),
        ("task", 5),
        ("task", "nothing"),
        ("thresholds", 5),
        ("thresholds", ["a"]),
        ("thresholds", {1: None, "b": None}),
        ("observes", "nothing"),
        ("informed", "yes"),
    ],
)
@pytest.mark.parametrize("kind", ["function", "class"])
def test_an_attribute_that_is_not_allowed_is_one_line(attribute, value, kind):
    def rule(rows, threshold):
        return np.ones(len(rows), np.int64)

    class Rule(SPRTDecider):
        pass

    if kind == "class" and (attribute, value) == ("default", 7):
        pytest.skip("a subclass may inherit a default that is not swept")
    model = rule if kind == "function" else Rule
    rule.thresholds = (0.1, 0.2)
    setattr(model, attribute, value)
    with pytest.raises(ArgumentError) as error:
        find_family(model, OPTIONS)

    assert "\n" not in str(error.value)
    words = {"task": "this one is for", "options": "options=|bank="}
    assert re.search(words.get(attribute, f"{attribute}="), str(error.value))


def leaves(rows):
    sys.exit(0)


class LeavesWhenMade:
    def __init__(self):
        raise SystemExit

    predict = None


class LeavesWhenItObserves(SPRTDecider):
    observes = "tracks"

    def observe(self, tracks):
        sys.exit()


@pytest.mark.parametrize("model", [leaves, LeavesWhenMade, LeavesWhenItObserves])
def test_a_rule_that_ends_the_program_is_one_line(model):
    family = find_family(model, OPTIONS)
    with pytest.raises(ArgumentError, match=r"failed in test_own.py line .*: SystemExit"):
        played(family, family.default)


def test_an_interrupt_by_the_user_stays_one():
    def interrupted(rows):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate(interrupted, episodes=1)


@pytest.mark.parametrize("kind", ["function", "class"])
def test_a_rule_that_asks_for_the_oracle_bank_is_marked_as_informed(kind):
    def rule(rows):
        return np.ones(len(rows), np.int64)

    class Rule(SPRTDecider):
        title = "mine"

    model = rule if kind == "function" else Rule

    assert not find_family(model, OPTIONS).make(0.1).informed
    model.options = {"bank": "oracle"}
    family = find_family(model, OPTIONS)
    assert family.name.endswith(", true anchor")
    assert family.options == {"bank": "oracle"}
    assert family.make(0.1).informed
