"""Times of a sensor as numbers of uniform ticks, as the filters of the banks need them."""

from contextlib import suppress
from datetime import datetime
from numbers import Real
from typing import Any

import numpy as np

from hybrid_env.checks import reject
from hybrid_env.compiled import internal


def number_of(time: Any) -> float:
    """Return a time as a number, of a date that since 1970 [s]; it may be NaN or infinite."""
    with suppress(OverflowError, ValueError, OSError):
        if isinstance(time, np.datetime64):
            return float((time - np.datetime64(0, "s")) / np.timedelta64(1, "s"))
        if isinstance(time, str):
            time = datetime.fromisoformat(time)
        if isinstance(time, datetime):
            return time.timestamp()
        if not isinstance(time, (bool, np.bool_, np.timedelta64)) and isinstance(time, Real):
            return float(time)
    raise reject("time", time, "a number, NaN if it is not known, or a date")


@internal
def advance(
    time: float, last: float, mean: float, tau: float, gain: float
) -> tuple[int, float, float, float]:
    """Return the number of ticks since the last one, the time less that of its tick, the time of
    this tick, and the mean distance; see `TickClock`.

    Args:
        time: of a measurement, at any time after the first one.
        last: time of the last tick.
        mean: distance of the last measurements.
        tau: length of a tick.
        gain: as of `TickClock`.
    """
    passed = time - last
    ticks = max(round((passed - mean) / tau), 1)
    late = passed - ticks * tau
    if late < -tau:
        return 0, passed, last, max(passed, -0.5 * tau)
    mean += gain * (late - mean)
    # The ticks follow from .6 of a tick on.
    shift = round(mean / (1.2 * tau))
    ticks += shift
    late -= shift * tau
    # Errors of rounding are no distance.
    late = late if abs(late) > 1e-6 * tau else 0.0
    return ticks, late, last + ticks * tau, mean - shift * tau


class TickClock:
    """Gives every time the tick that it belongs to, and its distance from that tick.

    A sensor whose clock jitters measures in every tick, so a measurement belongs to the tick that
    is nearest to its time less the mean distance of the last ones. Ticks are exactly uniform. If
    the true period differs a little from the tick, the distances grow, until a tick passes without
    a measurement, or a measurement has no tick of its own.

    Args:
        tau: length of a tick.

    Attributes:
        time: of the last tick, in the unit of tau; None before the first time.
    """

    # Share of a new distance in the mean distance.
    gain = 0.2

    def __init__(self, tau: float):
        self.tau = tau
        self.time: float | None = None
        self._mean = 0.0

    def advance(self, time: float) -> tuple[int, float]:
        """Return the number of ticks since the last one, and the time less that of its tick.

        The first time is a tick itself, of number 1. The number is 0 for a time that has no tick of
        its own.
        """
        if self.time is None:
            self.time = time
            return 1, 0.0
        known = self.time, self._mean, self.tau, self.gain
        ticks, late, self.time, self._mean = advance(time, *known)
        return ticks, late

    def tick(self) -> None:
        """Advance by a tick without a time."""
        if self.time is not None:
            self.time += self.tau
