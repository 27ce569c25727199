"""How the kernel's functions are compiled: small pieces, in which loops over lanes become SIMD code.

NumPy's error model lets a division stand in such a loop without the branch that would raise. What numba
does for any function is too much for sixty small ones at a first start, so those that only compiled code
calls take a shorter way: the passes that they need, LLVM once for all of them together.
"""

import functools
import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba import njit
from numba.core.base import BaseContext
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import PassManager
from numba.core.typed_passes import (
    NativeLowering,
    NoPythonBackend,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.types.functions import BaseFunction
from numba.core.untyped_passes import (
    FixupArgs,
    GenericRewrites,
    ReconstructSSA,
    TranslateByteCode,
)
from numba.extending import overload

PASSES = (
    TranslateByteCode,
    FixupArgs,
    GenericRewrites,
    ReconstructSSA,
    NopythonTypeInference,
    PreLowerStripPhis,
    NativeLowering,
    NoPythonBackend,
)
"""The passes that simple functions need.

There are no closures, no inlining, no literals and no raises with values, no check for what numba does not
support, and no release of variables, which is only needed where references are counted.
"""


class _Ingredient(JITCodeLibrary):
    """Code that is only ever linked into that of callers: neither optimised alone nor made executable.

    It stays apart from the code that it calls, so that everything is linked once.
    """

    def add_llvm_module(self, module: Any) -> None:
        self._final_module = module  # the only one: there are no wrappers

    def finalize(self) -> None:
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        for function in self._final_module.functions:
            if not function.is_declaration:
                function.linkage = "linkonce_odr"
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """For callers that numba compiles in its usual way: with all that it calls."""
        if self._shared_module is None:
            self._shared_module = self._final_module.clone()
            for module in _modules(self._linking_libraries):
                self._shared_module.link_in(module, preserve=True)
        return self._shared_module

    # numba would make a function for Python here; there is none, and no environment to give it

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Any:
        return self

    def set_env(self, name: str, environment: Any) -> None:
        pass


class _Whole(JITCodeLibrary):
    """Code with all that it calls, optimised once; numba's second time is for counts of references."""

    def finalize(self) -> None:
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        for module in _modules(self._linking_libraries):
            self._final_module.link_in(module, preserve=True)
        self._linking_libraries = []
        super().finalize()

    def _optimize_final_module(self) -> None:
        manager, builder = self._codegen._module_pass_manager()
        manager.run(self._final_module, builder)


def _modules(libraries: list[Any]) -> list[Any]:
    """The code of libraries and of all that they call, each once."""
    found: dict[Any, Any] = {}
    waiting = list(libraries)
    while waiting:
        library = waiting.pop()
        if library in found:
            continue
        if isinstance(library, _Ingredient):
            found[library] = library._final_module
            waiting += library._linking_libraries
        else:
            found[library] = library._get_module_for_linking()
    return list(found.values())


class _Internal(Compiler):
    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any):
        super().__init__(typing, target, _Ingredient(target.codegen(), "internal"), *rest)

    def define_pipelines(self) -> list[PassManager]:
        manager = PassManager("internal")
        for each in PASSES:
            manager.add_pass(each, each.name())
        manager.finalize()
        return [manager]


class _Outermost(Compiler):
    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any):
        whole = _Whole(target.codegen(), "whole")
        whole.enable_object_caching()
        super().__init__(typing, target, whole, *rest)

    def compile_extra(self, func: Any) -> Any:
        with _undisturbed():
            return super().compile_extra(func)


@contextmanager
def _undisturbed() -> Iterator[None]:
    """No collection of garbage, a seventh of the time; no operation or size looked up twice, an eighth.

    Methods of numba are exchanged for a while, under the lock that it holds while it compiles.
    """
    collects = gc.isenabled()
    operations: Any = BaseFunction
    target: Any = BaseContext
    look_up, measure = operations.get_call_type, target.get_abi_sizeof
    calls: dict[Any, Any] = {}

    def look_up_once(function: Any, context: Any, arguments: Any, keywords: Any) -> Any:
        if keywords:
            return look_up(function, context, arguments, keywords)
        call = function, arguments
        if call not in calls:
            calls[call] = look_up(function, context, arguments, keywords)
        return calls[call]

    gc.disable()
    operations.get_call_type, target.get_abi_sizeof = look_up_once, functools.cache(measure)
    try:
        yield
    finally:
        operations.get_call_type, target.get_abi_sizeof = look_up, measure
        if collects:
            gc.enable()


_options: Any = {
    "error_model": "numpy",
    "_nrt": False,  # nothing is allocated: counting references would take a quarter of a step
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": _Internal,
}

internal = njit(**_options)
"""A function for compiled code, and on disk a part of its caller. Called by Python it crashes."""

formula = njit(forceinline=True, **_options)
"""An internal function that becomes part of the loop it stands in."""

internal_overload: Any = functools.partial(overload, jit_options=_options)
"""Chooses an internal function by the types of its arguments, see `numba.extending.overload`."""

_kept: Any = {"error_model": "numpy", "no_cfunc_wrapper": True, "cache": True, "pipeline_class": _Outermost}

compiled = njit(**_kept)
"""A function that Python calls; kept on disk."""
