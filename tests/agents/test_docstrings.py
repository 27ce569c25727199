"""Every public class and method of `agents` has a docstring, or overrides a method that has one."""

import importlib
import inspect
import pkgutil

import pytest

import agents

MODULES = [module.name for module in pkgutil.walk_packages(agents.__path__, "agents.")]


@pytest.mark.parametrize("name", MODULES)
def test_what_is_public_is_described(name):
    module = importlib.import_module(name)
    kinds = [
        kind for kind in vars(module).values() if inspect.isclass(kind) and kind.__module__ == name
    ]
    for kind in kinds:
        assert kind.__doc__ or kind.__name__.startswith("_"), kind
        for member in (
            attribute
            for attribute in vars(kind)
            if not attribute.startswith("_") and not kind.__name__.startswith("_")
        ):
            described = inspect.isroutine(getattr(kind, member)) or isinstance(
                vars(kind)[member],
                property,
            )
            assert not described or inspect.getdoc(getattr(kind, member)), (
                f"{kind.__name__}.{member}"
            )
