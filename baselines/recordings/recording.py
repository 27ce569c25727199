"""A recording: the measured positions of one object, in the units of its file."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_env.checks import (
    AnyArray,
    ArgumentError,
    BoolArray,
    FloatArray,
    IntArray,
    Positive,
    check_array,
    checked,
    frozen,
    reject,
)
from hybrid_env.sensors import Radar

if TYPE_CHECKING:
    from baselines.recordings.projection import Projection


@dataclass(frozen=True, eq=False)
class Recording:
    """Measured positions of one object. `make_recording` checks arrays and makes one. A piece
    begins and ends with a measurement, may consist of a single row, and holds no two successive
    measurements that are further apart than the gap. Rows outside of all pieces have no
    measurement.
    """

    # Of the object.
    name: str
    # (n,) strictly increasing, of the rows [`time_unit`]
    times: FloatArray
    # (n, 2) measured x and y [`unit`]; both are NaN in a row without a measurement.
    positions: FloatArray
    # The median step of the times [`time_unit`]
    tick: float
    # First row and end of each piece between gaps, in order.
    pieces: tuple[tuple[int, int], ...]
    # Of length: `m`, another one that the file names, or `units` if it names none.
    unit: str = "units"
    # Or `ticks` for a recording without times.
    time_unit: str = "s"
    # Date of time 0 in UTC, ISO 8601; None for times without a date.
    epoch: str | None = None
    # From latitude and longitude to `positions`.
    projection: "Projection | None" = None
    # Whose ranges and bearings `positions` are converted from.
    radar: Radar | None = None
    # (n, k) its range rate, or without a radar velocities vx, vy [`unit` / `time_unit`], NaN where
    # none is measured.
    rates: FloatArray | None = None
    # (n,) measured altitudes [`unit`], NaN where there is none; None without any.
    altitudes: FloatArray | None = None
    # Longest time between two measurements of a piece [`time_unit`]
    gap: float = math.inf
    # (n,) number of the line of each row in its file; None for arrays.
    lines: IntArray | None = None
    # (n,) times as the file has them, numbers or texts; None for arrays and without times.
    time_cells: AnyArray | None = None
    # Number of lines of the file that were left out, by the reason.
    left_out: Mapping[str, int] = field(default_factory=dict)

    @property
    def measured(self) -> BoolArray:
        """(n,) True for rows with a measurement."""
        return ~np.isnan(self.positions[:, 0])

    @property
    def dates(self) -> NDArray[np.datetime64] | None:
        """(n,) dates of the rows in UTC; None without an epoch."""
        return None if self.epoch is None else dates_since(self.epoch, self.times)


def dates_since(epoch: str, seconds: FloatArray) -> NDArray[np.datetime64]:
    """Return the dates [ns] of times since an epoch, ISO 8601 in UTC."""
    # Seconds since 1970 are exact to a microsecond.
    passed = np.round(seconds * 1e6).astype("timedelta64[us]")
    return np.datetime64(epoch.removesuffix("Z"), "ns") + passed


def iso_texts(dates: NDArray[np.datetime64]) -> AnyArray:
    """Return dates in UTC as texts of ISO 8601, all in seconds, milliseconds or microseconds."""
    for unit in ("s", "ms", "us"):
        if (dates == dates.astype(f"datetime64[{unit}]")).all():
            break
    texts = np.datetime_as_string(dates, unit=unit, casting="unsafe")
    return np.char.add(texts, "Z").astype(object)


def make_recording(
    times: ArrayLike | None,
    positions: ArrayLike,
    *,
    name: str = "object",
    gap: float | None = None,
    breaks: ArrayLike = (),
    time_unit: str | None = None,
    **further: Any,
) -> Recording:
    """Make a recording of arrays, or raise `ArgumentError` with the reason.

    Args:
        times: (n,) strictly increasing times [`time_unit`]; None for rows at uniform ticks.
        positions: (n, 2) x and y [`unit`]; NaN in either coordinate marks a missing measurement.
        name: of the object.
        gap: longest time between two measurements of one piece [`time_unit`]; None is 20 nominal
            ticks.
        breaks: rows at which a piece begins whatever the times are.
        time_unit: unit of time; None is `s`, and `ticks` without times.
        further: other attributes of `Recording`, such as `unit`, `epoch` and `projection`.
    """
    radar = further.get("radar")
    if radar is not None and (radar.period != 1 or math.isfinite(radar.range)):
        raise reject("radar", radar, "no period and no range: a recording holds what was measured")
    values = check_array("positions", positions, (None, 2), missing=True)
    values[np.isnan(values).any(axis=1)] = np.nan
    rows = np.flatnonzero(~np.isnan(values[:, 0]))
    if len(rows) < 2:
        raise ArgumentError(f"{name} has {len(rows)} measured positions: expected at least two")
    if times is None:
        times = np.arange(len(values))
        time_unit = time_unit or "ticks"
    instants = check_array("times", times, (len(values),))
    steps = np.diff(instants)
    if not (steps > 0.0).all():
        k = int(np.argmin(steps > 0.0)) + 1
        raise reject(f"times[{k}]", instants[k], f"a time after {instants[k - 1]:.12g}")
    tick = float(np.median(steps))
    longest = 20 * tick if gap is None else checked("gap", gap, Positive)
    # First measurement at or after a break.
    before = np.searchsorted(rows, np.asarray(breaks, int))
    ends = np.flatnonzero(np.diff(instants[rows]) > longest) + 1
    borders = np.unique([0, *ends, *before, len(rows)]).tolist()
    pieces = tuple((int(rows[first]), int(rows[end - 1]) + 1) for first, end in pairwise(borders))
    return Recording(
        name,
        frozen(instants),
        frozen(values),
        tick,
        pieces,
        time_unit=time_unit or "s",
        gap=longest,
        **further,
    )
