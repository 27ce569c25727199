"""One line that says what was read of a file."""

from collections.abc import Sequence

import numpy as np

from baselines.recordings.reading.columns import Columns
from baselines.recordings.reading.table import Table, counted
from baselines.recordings.reading.times import Times
from baselines.recordings.recording import Recording

LISTED = 6
JITTER = 1e-3
"""Steps that differ by more than this share of the tick are listed."""


def summarise(table: Table, found: Columns, times: Times, recordings: Sequence[Recording]) -> str:
    """Return file, rows, objects, tick, unit and extent, and what was left out or assumed."""
    unit, time_unit = recordings[0].unit, recordings[0].time_unit
    objects = counted(len(recordings), "object")
    if found.object is not None and len(recordings) > 1:
        objects += f" by '{table.label(found.object)}'"
    positions = np.concatenate([one.positions for one in recordings])
    low, high = np.nanmin(positions, axis=0), np.nanmax(positions, axis=0)
    parts = [
        f"{table.file}: {counted(len(table.frame), 'row')}",
        objects,
        _ticks(recordings, time_unit),
        f"x {low[0]:.6g} to {high[0]:.6g}, y {low[1]:.6g} to {high[1]:.6g} {unit}",
    ]
    if recordings[0].projection is not None:
        origin = recordings[0].projection
        centre = f" around {origin.latitude:.6g}, {origin.longitude:.6g}" if len(recordings) == 1 else ""
        parts.append(f"degrees projected to metres{centre}")
    if times.kind:
        parts.append(f"times are {times.kind}" + (f" from {times.epoch}" if times.epoch else ""))
    missing = sum(int((~one.measured).sum()) for one in recordings)
    if missing:
        parts.append(f"{counted(missing, 'row')} without a position")
    pieces = sum(len(one.pieces) for one in recordings)
    if pieces > len(recordings):
        parts.append(f"{counted(pieces, 'piece')} between gaps")
    if not table.headed and not found.chosen:
        parts.append(f"no header: columns taken as {', '.join(found.roles)}")
    parts += table.notes
    if found.index is not None:
        parts.append("index column " + ("not used" if "time" in found.roles else "taken as ticks"))
    if found.left_out:
        rest = len(found.left_out) - LISTED
        names = ", ".join(found.left_out[:LISTED]) + (f" and {rest} more" if rest > 0 else "")
        parts.append(f"columns not used: {names}")
    return "; ".join(parts)


def _ticks(recordings: Sequence[Recording], unit: str) -> str:
    ticks = [one.tick for one in recordings]
    steps = np.concatenate([np.diff(one.times) for one in recordings])
    text = f"tick {np.median(ticks):.6g} {unit}" if unit != "ticks" else "no times: a row is a tick (--tau)"
    if np.abs(steps - np.median(ticks)).max() > JITTER * np.median(ticks):
        text += f" (steps {steps.min():.4g} to {steps.max():.4g})"
    return text
