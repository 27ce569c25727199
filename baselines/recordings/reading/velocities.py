"""Measured velocities of a file: which unit and which direction its columns have, by what its
positions say. Positions and velocities are complex numbers here, x + i y.
"""

import numpy as np
import pandas as pd

from hybrid_env.checks import AnyArray, BoolArray, FloatArray

METRES = {"m": 1.0, "km": 1e3, "ft": 0.3048}
"""Units of positions that units of speeds go with [m]."""

SPEEDS = {
    "m/s": 1.0,
    "kn": 1852.0 / 3600.0,
    "km/h": 1.0 / 3.6,
    "mph": 0.44704,
    "ft/s": 0.3048,
    "tenths of a knot": 185.2 / 3600.0,
    "cm/s": 0.01,
    "mm/s": 0.001,
}
"""Units of speeds [m/s]."""


def _directions(first: FloatArray, second: FloatArray, polar: bool) -> dict[str, AnyArray]:
    """Return velocities (n,) by what the columns, (n,) each, may mean."""
    if not polar:
        velocities = first + 1j * second
        return {
            "x and y": velocities,
            "y and x": 1j * velocities.conj(),
            "x and -y": velocities.conj(),
        }
    # More than a circle is no course.
    course = np.where(np.abs(second) > 360.0, np.nan, second)
    return {
        "course in degrees from north": 1j * first * np.exp(-1j * np.radians(course)),
        "course in radians from the x axis": first * np.exp(1j * course),
    }


def _agreement(times: FloatArray, places: AnyArray, velocities: AnyArray) -> tuple[float, float]:
    """Return the error of the ways by the velocities, as a share of those by the positions, and the
    factor by which the velocities agree best with these.
    """
    steps = np.diff(times)
    way = np.append(0.0, np.cumsum(0.5 * (velocities[1:] + velocities[:-1]) * steps))
    long = np.append(0, np.cumsum(steps > 3.0 * np.median(steps)))
    best = np.inf, 1.0
    # Over long ways the noise of the positions counts less, over short ones that of the velocities.
    for rows in (1, 10, 100, 1000):
        if len(times) <= 2 * rows:
            break
        first = np.arange(0, len(times) - rows, max(rows // 2, 1))
        first = first[long[first] == long[first + rows]]
        seen, said = places[first + rows] - places[first], way[first + rows] - way[first]
        if seen.any() and said.any():
            factor = float(np.vdot(said, seen).real / np.vdot(said, said).real)
            error = np.linalg.norm(seen - factor * said) / np.linalg.norm(seen)
            best = min(best, (float(error), factor))
    return best


def find_velocities(rows: pd.DataFrame, polar: bool, unit: str | None) -> tuple[FloatArray, str]:
    """Return velocities (n, 2) in the units of positions and times, NaN where the columns have
    none, or (n, 0) where they agree with the positions in no unit and direction; and a note for the
    summary.

    Args:
        rows: `time`, `x`, `y`, and as `rate0` and `rate1` speed and course, or two coordinates.
        polar: whether they are speed and course.
        unit: of the positions.
    """
    nothing = np.empty((len(rows), 0))
    named = "speed and course" if polar else "velocities"
    times, places = rows.time.to_numpy(), (rows.x + 1j * rows.y).to_numpy()
    directions = _directions(rows.rate0.to_numpy(), rows.rate1.to_numpy(), polar)
    agreements = {}
    for direction, velocities in directions.items():
        known = np.isfinite(places + velocities)
        if known.sum() > 2:
            agreements[direction] = _agreement(times[known], places[known], velocities[known])
    direction = min(agreements, key=agreements.__getitem__, default="")
    error, factor = agreements.get(direction, (np.inf, 1.0))
    if not error < 0.05 or factor <= 0.0:
        share = f" ({100.0 * error:.0f} % of the way)" if np.isfinite(error) else ""
        return nothing, f"{named} contradict the positions{share} and are not used"
    metres = METRES.get(unit or "")
    scales = {name: speed / metres for name, speed in SPEEDS.items()} if metres else {"units": 1.0}
    name = min(scales, key=lambda each: abs(np.log(scales[each] / factor)))
    # A unit may be missed by a tenth.
    if abs(np.log(scales[name] / factor)) > np.log(1.1):
        return nothing, f"{named} are in no known unit and are not used"
    velocities = scales[name] * directions[direction]
    far = _far_rows(times, places, velocities)
    velocities[far] = np.nan
    left_out = f", {far.sum():,} of them contradict the positions" if far.any() else ""
    remedy = f"--columns {'speed' if polar else 'vx'}=none to ignore"
    return (
        np.column_stack([velocities.real, np.where(far, np.nan, velocities.imag)]),
        f"{named} used: {name}, {direction}{left_out} ({remedy})",
    )


@np.errstate(invalid="ignore", divide="ignore")
def _far_rows(times: FloatArray, places: AnyArray, velocities: AnyArray) -> BoolArray:
    """Return which rows (n,) have a velocity that is far from those by the positions around."""
    moved = np.full_like(velocities, np.nan)
    moved[2:-2] = (places[4:] - places[:-4]) / (times[4:] - times[:-4])
    errors = np.abs(velocities - moved)
    far: BoolArray = errors > max(
        6.0 * np.nanmedian(errors), 0.5 * np.nanmedian(np.abs(velocities))
    )
    return far
