"""The compiled entry points of the kernel, for each bank: of the environments, and on a live
sensor. The options are read at run time. On a live sensor the measurement comes from the caller;
all else is computed by the same functions, so that the same measurements give the same rows;
`irregular` is True in the parameters, because any measurement may be missing.
"""

import functools
from typing import Any

from hybrid_env.core import announced, kernel, unknown
from hybrid_env.core.bitcode import Kernel, call, load
from hybrid_env.core.compilation import compiled, prepare
from hybrid_env.core.memory import DenseImmBank, ImmBank, parameters_at

# Commands: of the environments the first two, on a live sensor the others.
STEP, RESET, MEASURE, BEGIN = range(4)


def entry_point(bank: type, parameters: Any, live: bool) -> Kernel:
    """Return the function, ready to be called, that advances tracks with these parameters, a record
    `PARAMETERS`, into which the address of its machine code is written if it came as bitcode.

    Its arguments are the address of such a record, whose arrays must exist during the call, and a
    command. `STEP` steps every track, and a terminated track begins its next episode; its last
    observation is the one on which the last decision was made. `RESET` begins a new episode on
    every track whose action is not 0. It returns `DECIDED` if any track made a decision, plus
    `TERMINATED` if any terminated; if the action of track i is outside the space, -1 - i, and no
    track is stepped; or -1 - N after an exception in the law of the user of N tracks. On a live
    sensor the commands are `MEASURE` and `BEGIN`, and it returns 0.
    """
    function, parameters["kernel"] = _ready(bank, live)
    return function


@functools.cache
def _ready(bank: type, live: bool) -> tuple[Kernel, int]:
    """Return the entry point of a bank, compiled; or if there is its bitcode, `call` and the
    address.
    """
    kernel = kernel_of(bank, live)
    address = load(kernel.__name__)
    if address:
        return call, address
    dispatcher: Kernel = compiled(kernel)
    prepare(dispatcher, 0, 0)
    return dispatcher, 0


def kernel_of(bank: type, live: bool) -> Kernel:
    """Return the entry point of a bank before it is compiled. Its name and what it refers to
    identify the machine code in the cache.
    """
    process = unknown if bank in (ImmBank, DenseImmBank) else announced

    def advance(address: int, command: int) -> int:
        return kernel.advance(command == RESET, process, bank, parameters_at(address))

    def advance_live(address: int, command: int) -> int:
        return process.advance_live(command == BEGIN, bank, parameters_at(address))

    function = advance_live if live else advance
    function.__name__ = function.__qualname__ = f"{bank.__name__}_{'live' if live else 'all'}"
    return function
