"""Files of users have helper modules of their own, and a digest covers what they import."""

import numpy as np
import pytest

from agents.evaluation.registry import find_family
from baselines.rules.own import find_own, own_digest
from hybrid_env import ArgumentError, WorldOptions

RULES = {
    "plain": "import consts\ndef rule(rows):\n    return consts.K",
    "from": "from consts import K\ndef rule(rows):\n    return K",
    "renamed": "import consts as c\ndef rule(rows):\n    return c.K",
    "lazy": "def rule(rows):\n    import consts\n    return consts.K",
    "indirect": "from middle import value\ndef rule(rows):\n    return value()",
    "package": "import library.inner\ndef rule(rows):\n    return library.inner.K",
    "package, from": "from library import inner\ndef rule(rows):\n    return inner.K",
    "folder": "from folder.deep import K\ndef rule(rows):\n    return K",
    "relative": "from . import consts\ndef rule(rows):\n    return consts.K",
    "relative, from": "from .consts import K\ndef rule(rows):\n    return K",
}


def write(folder, source, value):
    """Write a rule and helpers of every kind, which all have one value."""
    files = {
        "mine.py": source,
        "consts.py": f"K = {value}",
        "library/inner.py": f"K = {value}",
        "library/__init__.py": "from . import inner",
        "folder/deep.py": f"K = {value}",
        "middle.py": "def value():\n    import consts\n    return consts.K",
    }
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content + "\n")
    return f"{folder / 'mine.py'}:rule"


@pytest.mark.parametrize("kind", RULES)
def test_each_file_runs_with_the_helpers_beside_it(tmp_path, kind):
    first, second = (
        find_own(write(tmp_path / str(value), RULES[kind], value)) for value in (5, 40)
    )
    assert (first(None), second(None)) == (5, 40)


def test_two_files_of_a_folder_do_not_share_what_a_helper_keeps(tmp_path):
    source = "import consts\nconsts.K += 1\ndef rule(rows):\n    return consts.K"
    name = write(tmp_path, source, 1)
    (tmp_path / "other.py").write_text(source)

    assert [find_own(one)(None) for one in (name, f"{tmp_path / 'other.py'}:rule")] == [2, 2]


@pytest.mark.parametrize("kind", RULES)
def test_an_edited_helper_gives_another_digest_and_runs(tmp_path, kind):
    name = write(tmp_path, RULES[kind], 5)
    assert find_own(name)(None) == 5
    before = own_digest(name)
    assert before == own_digest(name)
    write(tmp_path, RULES[kind], 6)
    assert own_digest(name) != before
    assert find_own(name)(None) == 6


def test_a_file_that_a_rule_names_belongs_to_its_digest(tmp_path):
    (tmp_path / "limits.txt").write_text("5")
    source = (
        "from pathlib import Path\ndef rule(rows):\n    return"
        " Path(__file__).with_name('limits.txt').read_text()"
    )
    name = write(tmp_path, source, 1)
    before = own_digest(name)
    (tmp_path / "limits.txt").write_text("6")

    assert own_digest(name) != before


@pytest.mark.parametrize(
    "source",
    [
        "import importlib\nconsts = importlib.import_module('json')",
        "consts = __import__('json')",
        "from importlib import import_module as load",
        "exec('import json')",
        "import sys\nsys.path.insert(0, '.')",
    ],
)
def test_a_file_that_imports_what_it_does_not_name_has_no_digest(tmp_path, source):
    name = write(tmp_path, source + "\ndef rule(rows):\n    return 3", 1)
    assert find_own(name)(None) == 3
    assert own_digest(name) is None


def test_a_module_has_the_digest_of_its_package_at_its_import(tmp_path, monkeypatch):
    package = tmp_path / "package_of_a_user"
    write(package, "from package_of_a_user.consts import K\ndef rule(rows):\n    return K", 5)
    monkeypatch.syspath_prepend(tmp_path)

    assert find_own("package_of_a_user.mine:rule")(None) == 5
    before = own_digest("package_of_a_user.mine:rule")
    write(package, "K = 3", 6)
    assert before is not None
    assert own_digest("package_of_a_user.mine:rule") == before
    assert own_digest("json:loads") is None


def test_names_of_this_package_and_of_python_are_never_taken_from_beside_a_file(tmp_path):
    source = (
        "import json, numpy\nfrom baselines import SPRTDecider\ndef rule(rows):\n    return json,"
        " numpy, SPRTDecider"
    )
    name = write(tmp_path, source, 1)
    (tmp_path / "json.py").write_text("raise RuntimeError")
    for folder in ("baselines", "numpy"):
        (tmp_path / folder).mkdir()
    (tmp_path / "baselines" / "__init__.py").write_text("raise RuntimeError")
    _, found, _ = find_own(name)(None)

    assert found is np


def test_a_helper_that_is_missing_is_one_line(tmp_path):
    name = write(tmp_path, "import library.nothing\ndef rule(rows):\n    return 1", 1)
    with pytest.raises(
        ArgumentError,
        match=r"mine.py failed in mine.py line 1: ModuleNotFoundError",
    ):
        find_family(name, WorldOptions())
