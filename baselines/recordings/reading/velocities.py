"""Measured velocities of a file: which unit and which direction its columns have, by what its
positions say.
"""

import numpy as np

from hybrid_env.checks import FloatArray

METRES = {"m": 1.0, "km": 1e3, "ft": 0.3048}
"""Units of positions that units of speeds go with [m]."""


def _directions(columns: FloatArray, polar: bool) -> dict[str, FloatArray]:
    """Return velocities (n, 2) by what the columns, (n, 2), may mean."""
    first, second = columns.T
    if not polar:
        return {
            f"{u} and {v}": np.column_stack([x, y])
            for u, x, v, y in (
                ("x", first, "y", second),
                ("y", second, "x", first),
                ("x", first, "-y", -second),
            )
        }
    # More than a circle is no course.
    second = np.where(np.abs(second) > 360.0, np.nan, second)
    course = np.radians(second)
    return {
        f"course in {unit} from {axis}": np.column_stack(
            [first * np.cos(angle), first * np.sin(angle)]
        )
        for unit, axis, angle in (
            ("degrees", "north", 0.5 * np.pi - course),
            ("radians", "north", 0.5 * np.pi - second),
            ("degrees", "the x axis", course),
            ("radians", "the x axis", second),
        )
    }


def _ways(times: FloatArray, values: FloatArray, rows: int) -> tuple[FloatArray, FloatArray]:
    """Return ways (k, 2) by positions and by velocities over a number of rows, where no step is
    long. values: (n, 4) of x, y, vx, vy.
    """
    steps = np.diff(times)
    moved = 0.5 * (values[1:, 2:] + values[:-1, 2:]) * steps[:, None]
    way = np.cumsum(np.vstack([np.zeros(2), moved]), axis=0)
    long = np.cumsum(np.append(False, steps > 3.0 * np.median(steps)))
    first = np.arange(0, len(times) - rows, max(rows // 2, 1))
    first = first[long[first] == long[first + rows]]
    return values[first + rows, :2] - values[first, :2], way[first + rows] - way[first]


def _agreement(times: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Return the factor by which velocities agree best with positions, and the error that is left
    of a way, as its share.
    """
    best = 1.0, np.inf
    # Over long ways the noise of the positions counts less, over short ones that of the velocities.
    for rows in (1, 10, 100, 1000):
        if len(times) <= 2 * rows:
            break
        seen, said = _ways(times, values, rows)
        of_said, of_seen = (said**2).sum(), (seen**2).sum()
        if min(of_said, of_seen) > 0.0:
            factor = float((seen * said).sum() / of_said)
            error = float(np.sqrt(((seen - factor * said) ** 2).sum() / of_seen))
            best = min(best, (factor, error), key=lambda pair: pair[1])
    return best


def find_velocities(
    times: FloatArray, positions: FloatArray, columns: FloatArray, polar: bool, unit: str | None
) -> tuple[FloatArray, str]:
    """Return velocities (n, 2) in the units of positions and times, NaN where the columns of speed
    and course, or of two coordinates, agree with these in no unit and direction; and a note for the
    summary.

    Args:
        times: (n,) of the rows.
        positions: (n, 2) x and y, NaN without one.
        columns: (n, 2) speed and course, or two coordinates; NaN without one.
        polar: whether they are speed and course.
        unit: of the positions.
    """
    nothing = np.full_like(columns, np.nan)
    named = "speed and course" if polar else "velocities"
    found = []
    for direction, velocities in _directions(columns, polar).items():
        values = np.hstack([positions, velocities])
        known = np.isfinite(values).all(axis=1)
        if known.sum() > 2:
            found.append((*_agreement(times[known], values[known]), direction, velocities))
    factor, error, direction, velocities = min(
        found, key=lambda each: each[1], default=(1.0, np.inf, "", nothing)
    )
    # The error of the way by the velocities, over the way by the positions.
    if not error < 0.05 or factor <= 0.0:
        share = f" ({100.0 * error:.0f} % of the way)" if np.isfinite(error) else ""
        return nothing, f"{named} contradict the positions{share} and are not used"
    # Units of speeds [m/s].
    speeds = {
        "m/s": 1.0,
        "kn": 1852.0 / 3600.0,
        "km/h": 1.0 / 3.6,
        "mph": 0.44704,
        "ft/s": 0.3048,
        "tenths of a knot": 185.2 / 3600.0,
        "cm/s": 0.01,
        "mm/s": 0.001,
    }
    metres = METRES.get(unit or "")
    scales = {name: value / metres for name, value in speeds.items()} if metres else {"units": 1.0}
    name = min(scales, key=lambda each: abs(np.log(scales[each] / factor)))
    # A unit may be missed by a tenth.
    if abs(np.log(scales[name] / factor)) > np.log(1.1):
        return nothing, f"{named} are in no known unit and are not used"
    velocities = velocities * scales[name]
    far = _far_rows(times, positions, velocities)
    velocities[far] = np.nan
    left_out = f", {far.sum():,} of them contradict the positions" if far.any() else ""
    remedy = f"--columns {'speed' if polar else 'vx'}=none to ignore"
    return velocities, f"{named} used: {name}, {direction}{left_out} ({remedy})"


def _far_rows(times: FloatArray, positions: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return which rows (n,) have a velocity that is far from those by the positions around."""
    around = np.hstack([positions, times[:, None]])
    moved = np.full_like(around, np.nan)
    moved[2:-2] = around[4:] - around[:-4]
    with np.errstate(invalid="ignore", divide="ignore"):
        errors = np.linalg.norm(velocities - moved[:, :2] / moved[:, 2:], axis=1)
        usual = np.nanmedian(np.linalg.norm(velocities, axis=1))
        return errors > max(6.0 * np.nanmedian(errors), 0.5 * usual)
