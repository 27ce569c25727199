"""The rule of the house: which folder may import which."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

MOST_FORMATTING_SKIPS = 20
SKIPS = tuple(f"# fmt: {word}" for word in ("skip", "off"))
# Each folder may import those before it, and itself.
LAYERS = ("hybrid_env", "baselines", "agents", "studies")
FOLDERS = (*LAYERS, "tests", "tools")


def imported(tree: ast.AST) -> Iterator[str]:
    """Yield the names of the modules that a file imports, anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module


def public_names(root: Path, package: str) -> set[str]:
    """Return the names that the stub of a package lists."""
    stub = root / package / "__init__.pyi"
    tree = ast.parse(stub.read_text(encoding="utf-8")) if stub.is_file() else ast.Module([], [])
    parts = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    return {alias.asname or alias.name for node in parts for alias in node.names}


def private_names(root: Path, path: Path) -> Iterator[str]:
    """Yield the names that a study imports from the packages although these do not publish them."""
    public = {package: public_names(root, package) for package in LAYERS[:-1]}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if "." in alias.name and alias.name.partition(".")[0] in public:
                    yield alias.name
        elif isinstance(node, ast.ImportFrom) and node.module:
            package = node.module.partition(".")[0]
            if package in public:
                for alias in node.names:
                    if node.module != package or alias.name not in public[package]:
                        yield f"{node.module}.{alias.name}"


def problems(root: Path) -> Iterator[str]:
    """Yield a line for each import that is not allowed, and for too many unformatted lines."""
    skips = 0
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            skips += sum(text.count(mark) for mark in SKIPS)
            if folder in LAYERS:
                later = LAYERS[LAYERS.index(folder) + 1 :]
                for name in imported(ast.parse(text)):
                    if name.partition(".")[0] in later:
                        yield f"{path.relative_to(root)} imports {name}: {folder} comes before it"
    for path in sorted((root / "studies").rglob("*.py")):
        if not path.name.startswith("test_"):
            for name in private_names(root, path):
                yield f"{path.relative_to(root)} imports {name}, which is not public"
    if skips > MOST_FORMATTING_SKIPS:
        yield f"{skips} lines are kept from the formatter, of at most {MOST_FORMATTING_SKIPS}"


def main() -> int:
    """Print the problems of this repository; return 1 if there are some."""
    found = list(problems(Path(__file__).parents[1]))
    print("\n".join(found), end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
