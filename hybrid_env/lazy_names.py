"""Names at the top of a package, each loaded from its file when it is first used (PEP 562, SPEC 1)."""

import importlib
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hybrid_env.extras import explained


def lazy_names(package: str) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__all__`, `__getattr__` and `__dir__` of a package, by the imports in its `__init__.pyi`."""
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
