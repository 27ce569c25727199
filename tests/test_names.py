"""The names at the top of the packages: lazy, the same for type checkers, and each importable
alone.
"""

import ast
import importlib
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("hybrid_env", "baselines", "agents")
NAMES = [
    (package, name) for package in PACKAGES for name in importlib.import_module(package).__all__
]


def python(code):
    command = [sys.executable, "-c", code]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize("package", PACKAGES)
def test_names_are_those_of_the_stub_and_of_the_page(package):
    tree = ast.parse((ROOT / package / "__init__.pyi").read_text(encoding="utf-8"))
    files = {line.names[0].asname: line.module for line in tree.body}
    module = importlib.import_module(package)
    page = (ROOT / "docs/api/index.md").read_text(encoding="utf-8")
    listed = [
        name
        for block in page.split(f".. currentmodule:: {package}\n")[1:]
        for name in re.findall(r"^   (\w+)$", block.partition("```")[0], re.MULTILINE)
    ]

    assert sorted(files) == sorted(module.__all__)
    assert set(module.__all__) <= set(dir(module))
    for name, file in files.items():
        assert getattr(module, name) is getattr(importlib.import_module(file), name)
        assert name in listed or f"`{package}.{name}`" in page
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'absent'"):
        module.absent  # noqa: B018


def test_they_are_few_and_load_nothing_slow_before_they_are_used():
    loaded = python("import sys, hybrid_env, baselines, agents; print(*sys.modules)").split()
    slow = {"matplotlib", "pygame", "torch", "pandas", "rich", "tyro", "numba", "scipy"}

    assert len(NAMES) <= 100
    assert "agents" in loaded
    assert not slow & set(loaded)


def defined(path):
    """Yield the public names that a file defines at its top."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        targets = getattr(node, "targets", [getattr(node, "target", node)])
        names = {getattr(target, "id", getattr(target, "name", "_")) for target in targets}
        yield from (name for name in names if not name.startswith("_"))


def test_no_public_name_is_defined_twice():
    """But in the core, where banks and kinds of switches are modules of the same functions."""
    core = ROOT / "hybrid_env/core"
    counts = Counter(
        name
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if not path.is_relative_to(core)
        for name in defined(path)
    )

    # The console script has one, and the commands that it loads have another one.
    assert counts.pop("main") == 2
    assert [name for name, count in counts.items() if count > 1] == []


@pytest.mark.study
@pytest.mark.parametrize(("package", "name"), NAMES)
def test_each_name_is_imported_alone_in_a_fresh_process(package, name):
    python(f"from {package} import {name}")
