"""The layout: which package imports which."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("hybrid_env", "baselines", "agents")
BASELINES = ("estimation", "scoring", "rules", "recordings")
AGENTS = (
    "interface",
    "figures",
    "learned",
    "evaluation",
    "training",
    "recordings",
    "commands",
)
SOURCES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def imported_modules(path):
    """Full names of the project's modules that a file imports, also inside functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} has a relative import"
            found |= {node.module} | {f"{node.module}.{name.name}" for name in node.names}
        elif isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
    return {name for name in found if name.partition(".")[0] in PACKAGES}


@pytest.mark.parametrize(
    "path",
    SOURCES,
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_a_file_imports_only_what_its_package_may(path):
    package, *inner = path.relative_to(ROOT).parts
    subpackage = inner[0] if len(inner) > 1 else None
    for name in imported_modules(path):
        other, _, rest = name.partition(".")
        assert PACKAGES.index(other) <= PACKAGES.index(package), f"{path} imports {name}"
        if package == "hybrid_env" and subpackage == "core":
            assert rest == "" or rest.startswith("core"), f"{path} imports {name}"
        part = rest.partition(".")[0]
        if package == other == "baselines" and subpackage and part in BASELINES:
            assert BASELINES.index(part) <= BASELINES.index(subpackage), f"{path} imports {name}"
        if package == other == "agents" and part in AGENTS and subpackage in AGENTS:
            assert AGENTS.index(part) <= AGENTS.index(subpackage), f"{path} imports {name}"


def test_only_the_public_interface_of_numba_is_used():
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.ImportFrom):
                names = [node.module or "", *(f"{node.module}.{name.name}" for name in node.names)]
            names += [name.name for name in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                assert name.split(".")[:2] not in (["numba", "core"], ["numba", "np"]), (
                    f"{path} imports {name}"
                )
                assert name.partition(".")[0] != "llvmlite", f"{path} imports {name}"


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("instance_class", "banks/operations.py"),
        (".nbi", "compilation.py"),
    ],
)
def test_what_leans_on_names_inside_numba_stands_in_one_file(name, file):
    using = [path for path in SOURCES if name in path.read_text(encoding="utf-8")]
    assert using == [ROOT / "hybrid_env/core" / file]
