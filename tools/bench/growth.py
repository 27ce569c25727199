"""How time and memory grow with tracks, hypotheses and segment length, and how long a first step
takes.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from hybrid_env.registration import make_vector_env
from tools.bench import timing
from tools.bench.environments import BANKS, ENV_ID, waiting_step
from tools.bench.timing import Measurement, figure, seconds_per_call

FloatArray = NDArray[np.float64]

FIRST_STEP = (
    "import hybrid_env, time; t = time.perf_counter(); env = hybrid_env.HybridTrackEnv();"
    " env.reset(seed=0); env.step(0); print(time.perf_counter() - t)"
)
"""Program that prints the seconds of a first step."""


def growth() -> Iterator[Measurement]:
    """Exponents of time over the upper decade of tracks and hypotheses, time over segment
    length, memory.
    """
    tracks = (1, 16, 256, 4096, 8192, 16384, 65536)
    costs = _nanoseconds([(count, 1, "random") for count in tracks])
    yield _growing("exponent in tracks", _exponents(tracks, costs * tracks), costs, tracks, "", 1.3)
    hypotheses = (3, 21, 41, 101, 201)
    costs = _nanoseconds([(512, count // 2, "random") for count in hypotheses])
    yield _growing(
        "exponent in hypotheses", _exponents(hypotheses, costs), costs, hypotheses, "", 1.1
    )
    lengths = (10, 100, 1000, 10_000)
    costs = _nanoseconds([(512, 1, f"random 6x{length}") for length in lengths])
    yield _growing(
        "long segments against 100 ticks", costs[:, -1] / costs[:, 1], costs, lengths, " ticks"
    )
    for name, radii in BANKS.items():
        env = make_vector_env(ENV_ID, 1024, radii=radii)
        yield figure(
            "memory",
            f"per track, {name}",
            sum(array.nbytes for array in env.world.arrays().values()) / 1024,
            "bytes",
        )


def _nanoseconds(cases: list[tuple[int, int, str]]) -> FloatArray:
    """(REPETITIONS, cases) of a step per track, measured in turn; cases: (tracks, radii,
    scheme).
    """
    steps = []
    for tracks, radii, scheme in cases:
        env = make_vector_env(
            ENV_ID,
            tracks,
            radii=tuple(range(1, radii + 1)),
            scheme=scheme,
            correctness="type",
            tick_info=False,
        )
        env.reset(seed=0)
        env.step(np.zeros(tracks, np.int64))
        steps.append(waiting_step(env))
    rounds = [[seconds_per_call(step) for step in steps] for _ in range(timing.REPETITIONS)]
    return 1e9 * np.array(rounds) / [tracks for tracks, _, _ in cases]


def _growing(
    name: str,
    figures: FloatArray,
    costs: FloatArray,
    sizes: Sequence[int],
    of: str,
    goal: float | None = None,
) -> Measurement:
    shown = ", ".join(
        f"{size:,}{of}: {cost:,.0f} ns"
        for size, cost in zip(sizes, np.median(costs, axis=0), strict=True)
    )
    return figure("growth", name, figures, "", goal=goal, at_most=True, detail=f"{shown} per track")


def _exponents(sizes: Sequence[int], times: FloatArray) -> FloatArray:
    upper = np.array(sizes) >= sizes[-1] / 10
    return np.asarray(np.polyfit(np.log(sizes)[upper], np.log(times[:, upper]).T, 1)[0])


def start_up() -> Iterator[Measurement]:
    """The first step after import, each in a new process, with an empty and with a filled
    compile cache.
    """
    seconds = []
    for _ in range(timing.REPETITIONS):
        with tempfile.TemporaryDirectory() as folder:
            environment = os.environ | {"NUMBA_CACHE_DIR": folder}
            for _ in ("empty", "filled"):
                printed = subprocess.check_output(
                    [sys.executable, "-c", FIRST_STEP], env=environment
                )
                seconds.append(float(printed))
    cold = seconds[::2]
    warm = seconds[1::2]
    yield figure("start-up", "first step, empty cache", cold, "s", goal=7.3, at_most=True)
    yield figure("start-up", "first step, filled cache", warm, "s", goal=1.0, at_most=True)
