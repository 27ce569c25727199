"""Names at the top of a package, each loaded from its file when it is first used (PEP 562)."""

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any

from hybrid_env.extras import explained


def lazy_names(
    package: str, files: Mapping[str, str]
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__all__`, `__getattr__` and `__dir__` of a package.

    Args:
        package: its name.
        files: names to load, separated by blanks, by the module of the package that defines them.
    """
    modules = {name: f"{package}.{file}" for file, names in files.items() for name in names.split()}

    def load(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        with explained():
            value = getattr(importlib.import_module(modules[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return sorted(modules), load, lambda: sorted({*vars(sys.modules[package]), *modules})
