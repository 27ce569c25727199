"""What is loaded when it is first used: optional dependencies, and names at the top of a package
(PEP 562, SPEC 1).
"""

import importlib
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

from hybrid_env.core.errors import ArgumentError

DISTRIBUTION = "hybrid-track"


class MissingExtraError(ArgumentError, ModuleNotFoundError):
    """A module of an optional dependency is missing. The message is one line that says how to
    install it.
    """


@contextmanager
def explained() -> Iterator[None]:
    """Raise `MissingExtraError` in place of the error of a missing module that an extra brings."""
    try:
        yield
    except ModuleNotFoundError as error:
        extra = extra_of(error.name or "")
        if extra is None:
            raise
        raise MissingExtraError(
            f"{error.name} is missing: this needs the extra [{extra}]:"
            f" pip install '{DISTRIBUTION}[{extra}]'"
        ) from None


def extra_of(module: str) -> str | None:
    """Return the first extra of pyproject.toml that brings a module; None if none does."""
    top = module.partition(".")[0]
    # Distributions that are not called as their modules.
    other = {"PIL": "pillow", "pygame": "pygame-ce", "yaml": "pyyaml"}
    wanted = other.get(top, top).replace("_", "-").lower()
    try:
        requirements = metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        return None
    matches = (re.match(r"([\w.-]+).*\bextra == ['\"]([\w-]+)['\"]", line) for line in requirements)
    named = ((match[1].lower(), match[2]) for match in matches if match)
    return next((extra for name, extra in named if name == wanted), None)


def lazy_names(package: str) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__all__`, `__getattr__` and `__dir__` of a package, by the imports in its
    `__init__.pyi`.
    """
    stub = Path(str(sys.modules[package].__file__)).with_suffix(".pyi").read_text(encoding="utf-8")
    modules = {name: module for module, name in re.findall(r"^from (\S+) import (\w+)", stub, re.M)}

    def load(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        with explained():
            value = getattr(importlib.import_module(modules[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return sorted(modules), load, lambda: sorted({*vars(sys.modules[package]), *modules})
