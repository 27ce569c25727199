"""Speed of a bank's step and of a paper's study against NumPy and filterpy."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from agents.benchmark import timing
from agents.benchmark.environments import BANKS
from agents.benchmark.peers import FilterpyBank, NumpyBank, has_filterpy
from agents.benchmark.timing import Measurement, measure_in_turn, seconds_per_call, speed_ratio
from baselines.papers import golubkov2018
from hybrid_env import KalmanBank
from hybrid_env.simulation import simulate


def bank_step() -> Iterator[Measurement]:
    """One tick of a bank against filterpy's KalmanFilter and plain NumPy, a 4x4 filter a hypothesis."""
    measurement = np.array([0.1, 0.2])
    for name, radii in BANKS.items():
        bank = KalmanBank(radii)
        bank.anchor(golubkov2018.START)
        for other, peer in (("NumPy 4x4", NumpyBank), ("filterpy", FilterpyBank)):
            if peer is NumpyBank or has_filterpy():
                ours, theirs = measure_in_turn(
                    partial(bank.step, measurement), partial(peer(radii).step, measurement)
                )
                yield speed_ratio("bank step", f"{name}, against {other}", ours, theirs)


def study_2018() -> Iterator[Measurement]:
    """ATE over 100 runs of the 2018 scheme against filterpy filters, extrapolated from some ticks."""
    if not has_filterpy():
        return
    recording = simulate(golubkov2018.SCHEME, 100, 0, start=golubkov2018.START)
    bank_ticks = int(golubkov2018.run_ate(recording, 0.1).ticks.sum())  # while the whole bank runs
    alone_ticks = recording.measurements[:, :, 0].size - bank_ticks
    z = np.array([0.1, 0.2])
    bank, alone = FilterpyBank(golubkov2018.RADII), FilterpyBank(())
    ours, theirs = [], []
    for _ in range(timing.REPETITIONS):
        ours.append(seconds_per_call(lambda: golubkov2018.run_ate(recording, 0.1)))
        bank_time, alone_time = (seconds_per_call(partial(peer.step, z)) for peer in (bank, alone))
        theirs.append(bank_ticks * bank_time + alone_ticks * alone_time)
    yield speed_ratio(
        "2018 study against filterpy", f"100 runs, R2, from {timing.SECONDS} s of each kind of tick",
        ours, theirs, 2000.0,
    )  # fmt: skip
