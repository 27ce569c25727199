"""The names at the top of the packages: lazy, the same for type checkers, and each importable
alone.
"""

import ast
import importlib
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from hybrid_env import extras

ROOT = Path(__file__).parents[1]
PACKAGES = ("hybrid_env", "baselines", "agents")
PAGE = (ROOT / "docs/api/names.md").read_text(encoding="utf-8")
NAMES = [
    (package, name) for package in PACKAGES for name in importlib.import_module(package).__all__
]
SLOW = {"matplotlib", "pygame", "torch", "pandas", "rich", "tyro", "numba", "scipy"}


def python(code):
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize("package", PACKAGES)
def test_type_checkers_see_the_same_names_in_the_same_files(package):
    tree = ast.parse((ROOT / package / "__init__.pyi").read_text(encoding="utf-8"))
    seen = {line.names[0].asname: line.module for line in tree.body}
    module = importlib.import_module(package)

    assert sorted(seen) == sorted(module.__all__)
    for name, file in seen.items():
        assert getattr(module, name) is getattr(importlib.import_module(file), name)


def test_they_stand_on_one_page_and_are_few():
    assert len(NAMES) <= 100
    for package, name in NAMES:
        assert f"`{name}`" in PAGE.partition(f"`{package}`")[2], name


def test_importing_the_packages_loads_nothing_that_is_slow():
    code = "import sys, hybrid_env, baselines, agents; print(*sys.modules)"
    loaded = set(python(code).stdout.split())

    assert "agents" in loaded
    assert not loaded & SLOW


@pytest.mark.parametrize("package", PACKAGES)
def test_all_names_are_imported_by_a_star(package):
    module = importlib.import_module(package)
    found = python(f"from {package} import *; print(*(name for name in dir() if name[:2] != '__'))")

    assert set(module.__all__) <= set(found.stdout.split()), found.stderr
    assert set(module.__all__) <= set(dir(module))
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'absent'"):
        module.absent  # noqa: B018


@pytest.mark.study
@pytest.mark.parametrize(("package", "name"), NAMES)
def test_each_name_is_imported_alone_in_a_fresh_process(package, name):
    found = python(f"from {package} import {name}")
    assert found.returncode == 0, found.stderr


@pytest.mark.parametrize(
    ("module", "extra"),
    [
        ("torch.nn", "agents"),
        ("yaml", "agents"),
        ("matplotlib.figure", "play"),
        ("unknown", None),
        ("pandas", "recordings"),
        ("sb3_contrib", "recurrent"),
        ("numpy", None),
    ],
)
def test_a_missing_module_is_explained_by_its_extra(module, extra, monkeypatch):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = [*project["dependencies"]]
    for name, wanted in project["optional-dependencies"].items():
        lines += [f'{one}; extra == "{name}"' for one in wanted]
    monkeypatch.setattr(extras.metadata, "requires", lambda distribution: lines)

    assert extras.extra_of(module) == extra
    with pytest.raises(ModuleNotFoundError) as caught, extras.explained():
        raise ModuleNotFoundError("No module named ...", name=module)
    advice = (
        f"{module} is missing: this needs the extra [{extra}]: pip install 'hybrid-track[{extra}]'"
    )
    assert str(caught.value) == ("No module named ..." if extra is None else advice)
