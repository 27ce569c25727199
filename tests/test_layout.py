"""The layout: which folder of a package imports which, and what is used of numba."""

import ast
from pathlib import Path

import pytest

from tools.house import imported

ROOT = Path(__file__).parents[1]
# Each folder, and each file beside them, imports those before it.
LAYERS = {
    "baselines": ("estimation", "scoring", "rules", "recordings"),
    "agents": (
        *("interface", "figures", "learned", "evaluation", "training", "algorithms"),
        *("comparison", "recordings", "functions", "commands", "cli"),
    ),
}
SOURCES = [
    path for package in ("hybrid_env", *LAYERS) for path in sorted((ROOT / package).rglob("*.py"))
]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_imports_only_what_its_folder_may(path):
    package, folder, *_ = path.relative_to(ROOT).parts
    order, folder = LAYERS.get(package, ()), folder.removesuffix(".py")
    assert folder in (*order, "__init__") or package == "hybrid_env"
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for name in imported(tree):
        other, part, *_ = [*name.split("."), ""]
        if path.is_relative_to(ROOT / "hybrid_env/core") and other == package:
            assert part in ("", "core"), name
        if other == package and folder in order and part in order:
            assert order.index(part) <= order.index(folder), name
        # Numba is used by its public interface.
        assert (other, part) not in {("numba", "core"), ("numba", "np")}
        assert name != "llvmlite.binding" or path.name == "bitcode.py"
        assert other != "llvmlite" or part == "binding"


@pytest.mark.parametrize(
    ("name", "file"), [("instance_class", "banks/operations.py"), (".nb?", "compilation.py")]
)
def test_what_leans_on_names_inside_numba_stands_in_one_file(name, file):
    using = [path for path in SOURCES if name in path.read_text(encoding="utf-8")]
    assert using == [ROOT / "hybrid_env/core" / file]
