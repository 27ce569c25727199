"""Timing of two functions side by side, the measurement that results, and the table of
measurements.

The two are called in turn, A B A B, in one process. The figure is the median of the ratios of the
pairs, so that a drift of the machine's speed affects both sides.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

REPETITIONS = 7
# Length of one measurement, about.
SECONDS = 0.05
# Length of one measurement by Gymnasium.
WHOLE_SECONDS = 1


@dataclass(frozen=True)
class Measurement:
    """One line of the report.

    Attributes:
        group, name: what is measured.
        value: the figure, a ratio where `goal` is one.
        low, high: its range over repetitions.
        unit: of the figure; "x" means times as fast as the other.
        goal: None where the figure is only reported.
        at_most: the goal is an upper bound, else a lower one.
        detail: absolute times.
    """

    group: str
    name: str
    value: float
    low: float
    high: float
    unit: str
    goal: float | None = None
    at_most: bool = False
    detail: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the goal is reached; None without a goal."""
        if self.goal is None:
            return None
        return self.value <= self.goal if self.at_most else self.value >= self.goal


def figure(group: str, name: str, figures: ArrayLike, unit: str, **options: Any) -> Measurement:
    """The median of some figures with their range; options are further attributes of
    `Measurement`.
    """
    low, middle, high = np.percentile(np.asarray(figures, np.float64), [0, 50, 100])
    return Measurement(group, name, float(middle), float(low), float(high), unit, **options)


def seconds_per_call(function: Callable[[], Any]) -> float:
    """Mean time of a call [s] over enough calls to take `SECONDS`."""
    count = 1
    while True:
        started = time.perf_counter()
        for _ in range(count):
            function()
        elapsed = time.perf_counter() - started
        if elapsed >= SECONDS:
            return elapsed / count
        count = max(count + 1, int(count * min(1.2 * SECONDS / max(elapsed, 1e-9), 100.0)))


def measure_in_turn(
    ours: Callable[[], Any], theirs: Callable[[], Any]
) -> tuple[list[float], list[float]]:
    """Seconds per call of two functions, measured A B A B after one call of each."""
    ours()
    theirs()
    pairs = [(seconds_per_call(ours), seconds_per_call(theirs)) for _ in range(REPETITIONS)]
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs]


def speed_ratio(
    group: str,
    name: str,
    ours: list[float],
    theirs: list[float],
    goal: float | None = None,
    work: float = 1.0,
) -> Measurement:
    """How many times as fast ours is: theirs over ours, times the work of our call in units of
    theirs.
    """
    detail = f"{_time(float(np.median(ours)))} against {_time(float(np.median(theirs)))}"
    return figure(group, name, work * np.divide(theirs, ours), "x", goal=goal, detail=detail)


def _time(seconds: float) -> str:
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("us", 1e6)):
        if seconds * scale >= 1.0:
            return f"{seconds * scale:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def words(one: Measurement) -> tuple[str, str, str, str, str]:
    """Value, range, goal, whether it is met, and absolute times, as texts."""
    spread = "" if one.low == one.high else f"{one.low:.3g} to {one.high:.3g}"
    goal = "" if one.goal is None else f"{'<=' if one.at_most else '>='} {one.goal:g}"
    met = {True: "met", False: "not met", None: ""}[one.met]
    return f"{one.value:,.3g} {one.unit}".strip(), spread, goal, met, one.detail


def markdown(found: Sequence[Measurement], title: str) -> str:
    """Measurements as a table in Markdown."""
    lines = [
        f"{title}.",
        "",
        "| measurement | median | range | goal | | times |",
        "|---|---|---|---|---|---|",
    ]
    lines += [f"| {one.group}: {one.name} | " + " | ".join(words(one)) + " |" for one in found]
    return "\n".join(lines) + "\n"
