"""Whether a file without a column of objects holds more than one."""

import numpy as np
from numpy.typing import NDArray

MIN_ROWS = 8
WINDOW = 4
"""Rows among which the previous row of the same object is looked for."""

FAR = 10.0
"""A row is far from the previous one if another of the rows before it is so many times nearer."""

FAR_SHARE = 0.25
JUMP = 50.0
"""A jump is so many times faster than any other step."""

END_SHARE = 0.2
"""A jump this close to an end of the recording is an error of measurement rather than another object."""


def unmarked_objects(times: NDArray[np.float64], positions: NDArray[np.float64]) -> str | None:
    """Return why the rows seem to be of more than one object, None if they seem to be of one.

    Either the rows alternate: many are far from the row before, but near to one of the three rows before
    that. Or one object follows the other: a single step is far longer than all others.

    Args:
        times: (n,) increasing times.
        positions: (n, 2) positions, no NaN.
    """
    count = len(positions)
    if count < MIN_ROWS:
        return None
    before = np.full((WINDOW, count), np.inf)
    for lag in range(1, WINDOW + 1):
        before[lag - 1, lag:] = np.hypot(*(positions[lag:] - positions[:-lag]).T)
    nearest = before.min(axis=0)[WINDOW:]
    far = before[0, WINDOW:] > FAR * nearest
    if np.median(nearest) > 0.0 and far.mean() >= FAR_SHARE:
        return "rows alternate between places that are far apart"
    speeds = before[0, 1:] / np.diff(times)
    at = int(np.argmax(speeds))
    others = np.delete(speeds, at).max()
    if speeds[at] > JUMP * others > 0.0 and END_SHARE <= (at + 1) / count <= 1.0 - END_SHARE:
        return (
            f"a jump of {before[0, at + 1]:.6g}, {speeds[at] / others:.0f} times faster than any other step"
        )
    return None
