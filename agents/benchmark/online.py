"""Time of a measurement of the on-line tracker, and that of its decider alone."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from agents.benchmark.timing import Measurement, measure_in_turn
from baselines import CusumDecider, MSPRTDecider, OnlineTracker, SPRTDecider, ThresholdDecider
from hybrid_env import QuickestOptions, WorldOptions

GOAL = 20.0  # us
SEGMENT = 50  # ticks between announced switches

CASES: dict[str, tuple[Callable[[], OnlineTracker], float | None]] = {
    "unknown switches, threshold": (lambda: OnlineTracker(QuickestOptions(), ThresholdDecider()), GOAL),
    "unknown switches, CUSUM": (lambda: OnlineTracker(QuickestOptions(), CusumDecider()), None),
    "announced switches, MSPRT": (lambda: OnlineTracker(WorldOptions(), MSPRTDecider()), GOAL),
    "announced switches, SPRT": (lambda: OnlineTracker(WorldOptions(), SPRTDecider()), None),
}
"""How each tracker is made, and its goal [us]."""


def online_tracker() -> Iterator[Measurement]:
    """A measurement of an object on a straight line, its time included, with 3 hypotheses."""
    for name, (make, goal) in CASES.items():
        sensor = _Sensor(make())
        for _ in range(SEGMENT):
            sensor.measure()
        row, decider = sensor.tracker.world.take_rows(), sensor.tracker.decider
        _, state = decider.predict(row, None, np.ones(1, np.bool_), True)
        asked = partial(decider.predict, row, state, np.zeros(1, np.bool_), True)
        times, alone = (1e6 * np.array(one) for one in measure_in_turn(sensor.measure, asked))
        low, middle, high = np.percentile(times, [0, 50, 100])
        yield Measurement(
            "on-line tracker, a measurement, 3 hypotheses", name, middle, low, high, "us", goal,
            at_most=True, detail=f"{np.median(alone):.3g} us a call of the decider alone",
        )  # fmt: skip


class _Sensor:
    """Feeds a tracker with noisy measurements of an object on a straight line."""

    def __init__(self, tracker: OnlineTracker):
        self.tracker, self.tick = tracker, 0
        self.noise = np.random.default_rng(0).normal(0.0, 0.3, (997, 2)).tolist()
        self.announced = isinstance(tracker.options, WorldOptions)

    def measure(self) -> None:
        self.tick += 1
        if self.announced and self.tick % SEGMENT == 0:
            self.tracker.switch(SEGMENT)
        x, y = self.noise[self.tick % len(self.noise)]
        self.tracker.update((0.2 * self.tick + x, y), 0.1 * self.tick)
