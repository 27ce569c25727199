"""Training algorithms by name: those of the package by the name of their file, those of studies and
of users by "package.module:Name".
"""

import pkgutil
from importlib import import_module
from typing import Any

from agents.interface.world_arguments import TRUST, trusted
from baselines.rules.external import find_external
from hybrid_env.checks import reject

REGISTERED: dict[str, Any] = {}
"""Classes of algorithms by name: all that have been imported."""


def algorithm_names() -> list[str]:
    """Return the names of the algorithms of the package."""
    package = import_module("agents.algorithms")
    return [module.name for module in pkgutil.iter_modules(package.__path__)]


def find_algorithm(name: Any, *, imported: bool = False) -> Any:
    """Return the class of an algorithm.

    Args:
        name: of this package, or "package.module:Name".
        imported: import the module of such a name, which runs its code. If False, as for the names
            in files of weights, it must have been imported, or policies of others are `trusted`.
    """
    names = algorithm_names()
    if name in names:
        import_module(f"agents.algorithms.{name}")
    elif isinstance(name, str) and name not in REGISTERED and (imported or trusted()):
        kind = find_external(name)
        if any(kind is other for other in REGISTERED.values()):
            return kind
    if not isinstance(name, str) or name not in REGISTERED:
        of_others = f"package.module:Name, with {TRUST}=1 if it is not imported"
        allowed = f"{', '.join(names)}, or {of_others}"
        raise reject("algo", name, allowed)
    return REGISTERED[name]
