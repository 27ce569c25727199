"""How time and memory grow with tracks, hypotheses and segment length, and how long a first step takes."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from agents.benchmark import timing
from agents.benchmark.environments import BANKS, ENV_ID, waiting_step
from agents.benchmark.timing import Measurement, seconds_per_call
from hybrid_env.registration import make_vector_env

FloatArray = NDArray[np.float64]


def growth() -> Iterator[Measurement]:
    """Exponents of time over the upper decade of tracks and hypotheses, time over segment length, memory."""

    def nanoseconds(worlds: list[tuple[int, int, str]]) -> FloatArray:
        """(REPETITIONS, worlds) of a step per track, measured in turn; worlds: (tracks, radii, scheme)."""
        steps = []
        for tracks, radii, scheme in worlds:
            env = make_vector_env(
                ENV_ID, tracks, radii=tuple(range(1, radii + 1)), scheme=scheme,
                correctness="type", tick_info=False,
            )  # fmt: skip
            env.reset(seed=0)
            env.step(np.zeros(tracks, np.int64))
            steps.append(waiting_step(env))
        rounds = [[seconds_per_call(step) for step in steps] for _ in range(timing.REPETITIONS)]
        return 1e9 * np.array(rounds) / [tracks for tracks, _, _ in worlds]

    def growing(
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
        low, middle, high = np.percentile(figures, [0, 50, 100])
        detail = f"{shown} per track"
        return Measurement("growth", name, middle, low, high, "", goal, at_most=True, detail=detail)

    def exponents(sizes: Sequence[int], times: FloatArray) -> FloatArray:
        upper = np.array(sizes) >= sizes[-1] / 10
        return np.asarray(np.polyfit(np.log(sizes)[upper], np.log(times[:, upper]).T, 1)[0])

    tracks = (1, 16, 256, 4096, 8192, 16384, 65536)
    costs = nanoseconds([(count, 1, "random") for count in tracks])
    yield growing("exponent in tracks", exponents(tracks, costs * tracks), costs, tracks, "", 1.3)
    hypotheses = (3, 21, 41, 101, 201)
    costs = nanoseconds([(512, count // 2, "random") for count in hypotheses])
    yield growing("exponent in hypotheses", exponents(hypotheses, costs), costs, hypotheses, "", 1.1)
    lengths = (10, 100, 1000, 10_000)
    costs = nanoseconds([(512, 1, f"random 6x{length}") for length in lengths])
    yield growing("long segments against 100 ticks", costs[:, -1] / costs[:, 1], costs, lengths, " ticks")
    for name, radii in BANKS.items():
        env = make_vector_env(ENV_ID, 1024, radii=radii)
        size = env.world.nbytes / 1024
        yield Measurement("memory", f"per track, {name}", size, size, size, "bytes")


def start_up() -> Iterator[Measurement]:
    """The first step after import, each in a new process, with an empty and with a filled compile cache."""
    code = (
        "import hybrid_env, time; t = time.perf_counter(); "
        "env = hybrid_env.HybridTrackEnv(); env.reset(seed=0); env.step(0); print(time.perf_counter() - t)"
    )
    seconds = []
    for _ in range(timing.REPETITIONS):
        with tempfile.TemporaryDirectory() as folder:
            environment = os.environ | {"NUMBA_CACHE_DIR": folder}
            for _ in ("empty", "filled"):
                command = [sys.executable, "-c", code]
                seconds.append(float(subprocess.check_output(command, env=environment, text=True)))
    for name, goal, taken in (
        ("first step, empty cache", 7.3, seconds[::2]),
        ("first step, filled cache", 1.0, seconds[1::2]),
    ):
        low, middle, high = np.percentile(taken, [0, 50, 100])
        yield Measurement("start-up", name, middle, low, high, "s", goal, at_most=True)
