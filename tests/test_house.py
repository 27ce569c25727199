"""The check of the direction of imports, `tools.house`."""

from pathlib import Path

import pytest

from tools.house import problems


def tree(folder, **files):
    for name, text in files.items():
        path = (folder / name.replace("__", "/")).with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return list(problems(folder))


def test_this_repository_has_no_problem():
    assert list(problems(Path(__file__).parents[1])) == []


@pytest.mark.parametrize(
    ("package", "line"),
    [("hybrid_env", "from baselines.rules import msprt"), ("agents", "import studies")],
)
def test_an_import_in_the_wrong_direction_is_a_problem(tmp_path, package, line):
    right = {"studies__a": "import agents\n", "agents__b": "import hybrid_env\n"}
    assert tree(tmp_path, **right) == []

    (problem,) = tree(tmp_path, **{f"{package}__a": f"def call():\n    {line}\n"})
    assert problem.startswith(f"{package}/a.py imports {line.split()[1]}")


@pytest.mark.parametrize("line", ["from agents.a import f", "from agents import g"])
def test_a_study_that_imports_a_private_name_is_a_problem(tmp_path, line):
    (tmp_path / "agents").mkdir()
    (tmp_path / "agents/__init__.pyi").write_text("from agents.a import f as f\n")
    allowed = {"studies__a": "from agents import f\n"}

    assert tree(tmp_path, **allowed) == []
    (problem,) = tree(tmp_path, **allowed, studies__b=f"{line}\n")
    assert problem.startswith("studies/b.py imports agents.")
    assert "not public" in problem
