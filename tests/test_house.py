"""The check of density and of the direction of imports, `tools.house`."""

from pathlib import Path

import pytest

from tools.house import problems

ROOT = Path(__file__).parents[1]


def tree(folder, **files):
    for name, text in files.items():
        path = folder / name.replace("__", "/")
        path = path.with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return list(problems(folder))


def test_this_repository_has_no_problem():
    assert list(problems(ROOT)) == []


@pytest.mark.parametrize(
    ("package", "line"),
    [
        ("hybrid_env", "from baselines.rules import msprt"),
        ("baselines", "    import agents.training"),
        ("agents", "import studies"),
    ],
)
def test_an_import_in_the_wrong_direction_is_a_problem(tmp_path, package, line):
    source = f"def call():\n    {line.strip()}\n"
    (problem,) = tree(tmp_path, **{f"{package}__a": source})

    assert problem.startswith(f"{package}/a.py imports {line.split()[1]}")


def test_imports_in_the_right_direction_are_none(tmp_path):
    assert tree(tmp_path, studies__a="import agents\n", agents__b="import hybrid_env\n") == []


def test_dense_code_is_a_problem(tmp_path):
    assert tree(tmp_path, tests__a="x = 1\n") == []

    (problem,) = tree(tmp_path, tests__a="x = [1, 2, 3, 4, 5, 6, 7, 8]\n")
    assert problem == "tests has 14.00 nodes a line, of at most 7.0"


def test_many_lines_kept_from_the_formatter_are_a_problem(tmp_path):
    line = "x = 1  # " + "fmt: skip\n"
    assert tree(tmp_path, tests__a=line * 20) == []

    (problem,) = tree(tmp_path, tests__a=line * 21)
    assert problem == "21 lines are kept from the formatter, of at most 20"


@pytest.mark.parametrize(
    "line",
    ["from agents.a import f", "import agents.a", "from agents import g"],
)
def test_a_study_that_imports_a_private_name_is_a_problem(tmp_path, line):
    (tmp_path / "agents").mkdir()
    (tmp_path / "agents/__init__.pyi").write_text("from agents.a import f as f\n")
    allowed = {"studies__a": "from agents import f\n"}

    assert tree(tmp_path, **allowed) == []
    (problem,) = tree(tmp_path, **allowed, studies__b=f"{line}\n")
    assert problem.startswith("studies/b.py imports agents.")
    assert "not public" in problem
