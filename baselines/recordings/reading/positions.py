"""From cells to positions on a plane."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.reading.columns import Columns
from baselines.recordings.reading.names import DEGREES, split_unit
from baselines.recordings.reading.numbers import MAX_VALUE, coordinates
from baselines.recordings.reading.projection import Projection, centred_projection
from baselines.recordings.reading.table import Table
from hybrid_env.checks import ArgumentError, reject

MAX_LATITUDE, MAX_LONGITUDE = 90.0, 360.0  # [deg]
SLOW = 0.01
"""What is tracked moves less than so many degrees in a second, and most often more metres in a second."""

OFFSET = 2.0
"""Degrees are this far from 0, compared with their extent, and at least one degree."""


@dataclass(frozen=True, eq=False)
class Places:
    """Positions of all rows of a file.

    Attributes:
        values: (n, 2) x and y, or longitude and latitude [deg]; NaN where a cell is empty.
        unit: unit of the positions on the plane; None if the file does not name it.
        degrees: whether `values` are degrees.
    """

    values: NDArray[np.float64]
    unit: str | None
    degrees: bool

    @property
    def measured(self) -> NDArray[np.bool_]:
        """(n,) True for rows with both coordinates."""
        return np.asarray(~np.isnan(self.values).any(axis=1))

    def plane(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.float64], Projection | None]:
        """Return positions of rows on a plane, (k, 2), and the projection if they were degrees."""
        if not self.degrees or not self.measured[rows].any():
            return self.values[rows], None
        longitudes, latitudes = self.values[rows].T
        projection = centred_projection(latitudes, longitudes)
        return projection.forward(latitudes, longitudes), projection

    def check_unit(self, table: Table, seconds: NDArray[np.float64], rows: NDArray[np.int64]) -> None:
        """Check that x and y without a unit do not look like degrees.

        Args:
            table: the table.
            seconds: (k,) increasing times [s] of measurements, or numbers of rows.
            rows: (k,) their rows.

        Raises:
            ArgumentError: they do.
        """
        if self.unit is None and look_like_degrees(seconds, self.values[rows]):
            (west, south), (east, north) = self.values[rows].min(axis=0), self.values[rows].max(axis=0)
            raise ArgumentError(
                f"{table.file}: x from {west:.6g} to {east:.6g} and y from {south:.6g} to {north:.6g} look "
                "like degrees: --unit deg for longitude x and latitude y, or --unit m for a plane"
            )


def read_positions(table: Table, found: Columns, unit: str | None) -> Places:
    """Parse the columns of the positions.

    Args:
        table: the table.
        found: its columns.
        unit: unit of x and y; None takes it from the header.

    Raises:
        ArgumentError: a cell is not a number, a latitude or longitude is out of range, x and y have
            different units, or a unit is given for latitudes and longitudes.
    """
    axes = [found.roles[role] for role in (("lon", "lat") if found.degrees else ("x", "y"))]
    named = {split_unit(table.names[column])[1] for column in axes}
    degrees = found.degrees
    if degrees:
        if unit not in (None, "m", *DEGREES):
            raise reject("unit", unit, f"no value, as {table.file} has latitudes and longitudes")
    elif unit is None:
        if len(named) > 1:
            labels = " and ".join(repr(table.label(column)) for column in axes)
            raise ArgumentError(f"{table.file}: {labels} have different units: expected one, or --unit")
        unit = named.pop()
    if not degrees and unit is not None and unit.lower() in DEGREES:
        degrees = True
        table.notes.append("x taken as longitude and y as latitude")
    limits = (MAX_LONGITUDE, MAX_LATITUDE) if degrees else (MAX_VALUE, MAX_VALUE)
    cells = [coordinates(table, column, limit) for column, limit in zip(axes, limits, strict=True)]
    if any(one.comma for one in cells):
        table.notes.append("decimal comma")
    values = np.column_stack([one.values for one in cells])
    return Places(values, "m" if degrees else unit, degrees)


def look_like_degrees(seconds: NDArray[np.float64], positions: NDArray[np.float64]) -> bool:
    """Whether x and y without a unit may be degrees: in their range, slow, and far from 0 for their extent.

    Args:
        seconds: (n,) increasing times [s], or numbers of rows.
        positions: (n, 2) x and y, no NaN.
    """
    largest, extent = np.abs(positions).max(axis=0, initial=0.0), np.ptp(positions, axis=0)
    if (
        len(positions) < 2
        or largest.max() > MAX_LONGITUDE / 2.0
        or largest.min() > MAX_LATITUDE
        or not extent.any()
    ):
        return False
    speeds = np.abs(np.diff(positions, axis=0)).max(axis=1) / np.diff(seconds)
    offset = np.abs(np.median(positions, axis=0)).max()
    return bool(np.median(speeds) < SLOW and offset > max(OFFSET * extent.max(), 1.0))
