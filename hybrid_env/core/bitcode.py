"""Kernels that a build has compiled to LLVM bitcode, beside the sources of the core: the first call
only turns them into machine code for the processor at hand, which takes a sixth of the time and
gives the same bits. The name of a file has a hash of the core's sources; with other sources, on
another system or with an older LLVM the kernel is compiled. `python -m tools.bitcode` writes them.
"""

import hashlib
import lzma
import math
import os
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from numba import cfunc, types

from hybrid_env.core.compilation import OPTIONS, cache_folder, compiled, config, prepare
from hybrid_env.core.memory import address_as, parameters_at

FOLDER = Path(__file__).parent
"""Of the sources of the core, and of the bitcode in an installation."""

Kernel = Callable[[int, int], int]

_KERNEL = types.int64(types.int64, types.int64)
_kernel_at = address_as(types.ExternalFunctionPointer(_KERNEL, int))
# Their code must not be freed.
_engines: list[Any] = []


@compiled
def call(address: int, command: int) -> int:
    """Call the kernel whose address is in the record `PARAMETERS` at an address. ctypes takes twice
    as long, and a third argument a tenth longer.
    """
    result: int = _kernel_at(parameters_at(address).kernel)(address, command)
    return result


def path_of(name: str, folder: Path) -> Path:
    """Return the file in a folder for the bitcode of a kernel of the present sources."""
    code = hashlib.sha256()
    for path in sorted(FOLDER.rglob("*.py")):
        code.update(path.read_bytes())
    return folder / f"{name}-{code.hexdigest()[:16]}.bc.xz"


def save(kernel: Kernel, folder: Path) -> None:
    """Write the bitcode of a kernel into a folder. numba must be told to compile for any processor,
    and not to optimise, see `tools/bitcode.py`: functions are inlined and simplified here, and the
    processor that loads them makes SIMD code of loops, which fully optimised ones no longer allow.
    """
    callback = cfunc(_KERNEL, **OPTIONS)(kernel)
    # Memory belongs to the caller, so that no references to it are counted.
    counting = r"(define [^\n]*@NRT_(?:in|de)cref\(.*?\{).*?\n\}"
    source = re.sub(counting, r"\1\n  ret void\n}", callback.inspect_llvm(), flags=re.DOTALL)
    module = llvm.parse_assembly(source)
    module.get_function(callback.native_name).name = name = kernel.__name__
    for part in module.functions:
        if not part.is_declaration and part.name != name:
            part.linkage = "internal"
    builder = _pass_builder(_machine("", ""), 1)
    builder.getModulePassManager().run(module, builder)
    path_of(name, folder).write_bytes(lzma.compress(module.as_bitcode()))


def load(name: str, folder: Path = FOLDER) -> int:
    """Return the address of a kernel whose bitcode is in a folder, for `call`; 0 if it has to be
    compiled. The cache keeps its machine code.
    """
    path = path_of(name, folder)
    # Settings of numba that the kernel would not follow.
    settings = config.DISABLE_JIT or config.BOUNDSCHECK or config.CPU_NAME or config.CPU_FEATURES
    if settings or not path.is_file():
        return 0
    # It also tells LLVM where the functions of the C library are.
    prepare(call, 0, 0, announced=False)
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    machine = _machine(cpu, features)
    made_from = hashlib.sha256(f"{cpu} {features}".encode() + path.read_bytes())
    cache = cache_folder(__file__, __name__)
    kept = Path(cache, f"{name}-{made_from.hexdigest()[:16]}.o")
    content = kept.read_bytes() if cache and kept.is_file() else b""
    # The hash of the code precedes it.
    code = content[32:]
    if hashlib.sha256(code).digest() != content[:32]:
        code = _machine_code(path, machine)
        if cache and code:
            with suppress(OSError):
                new = kept.with_suffix(f".{os.getpid()}")
                new.write_bytes(hashlib.sha256(code).digest() + code)
                new.replace(kept)
    if not code:
        return 0
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _engines.append(engine)
    address: int = engine.get_function_address(name)
    return address


def _machine(cpu: str, features: str) -> Any:
    """Return the compiler for a processor of this system."""
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(cpu=cpu, features=features, opt=3, jit=True)


def _pass_builder(machine: Any, level: int) -> Any:
    """Return the builder of the passes of an optimisation level, at the highest one, 3, those of
    numba.
    """
    tuning = llvm.PipelineTuningOptions(speed_level=level)
    tuning.loop_vectorization, tuning.slp_vectorization = level == 3, False
    return llvm.create_pass_builder(machine, tuning)


def _machine_code(path: Path, machine: Any) -> bytes:
    """Return the object file of a kernel for a processor; b"" if the file is damaged or this LLVM
    cannot read it, if it is for another system, or if it calls more than functions of `math`.
    """
    try:
        module = llvm.parse_bitcode(lzma.decompress(path.read_bytes()))
    except (RuntimeError, EOFError, lzma.LZMAError):
        return b""
    if module.triple != llvm.get_process_triple():
        return b""
    builder = _pass_builder(machine, 3)
    passes = builder.getModulePassManager()
    # Unrolled loops show that no function raises an exception.
    passes.add_ipsccp_pass()
    passes.add_simplify_cfg_pass()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, builder)
    called = {part.name for part in module.functions if part.is_declaration}
    called = {name for name in called if not name.startswith("llvm.")}
    # Nothing inside numba or Python, as to raise an exception.
    if not all(hasattr(math, name) and llvm.address_of_symbol(name) for name in called):
        return b""
    code: bytes = machine.emit_object(module)
    return code
