"""One line that says what was read of a file."""

import numpy as np

from baselines.recordings.reading import cleaning
from baselines.recordings.reading.columns import Columns
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import Times
from baselines.recordings.recording import Recording


def summary(table: Table, roles: Columns, times: Times, recordings: list[Recording]) -> str:
    """Return file, rows, objects, tick, unit and extent, and what was left out or assumed."""
    first, count = recordings[0], len(recordings)
    by = (
        f" by '{table.label(roles.roles['object'])}'"
        if count > 1 and "object" in roles.roles
        else ""
    )
    tick = np.median([recording.tick for recording in recordings])
    steps = np.concatenate([np.diff(recording.times) for recording in recordings])
    ticks = f"tick {tick:.6g} s" if first.time_unit == "s" else "no times: a row is a tick (--tau)"
    if np.abs(steps - tick).max() > 1e-3 * tick:
        ticks += f" (steps {steps.min():.4g} to {steps.max():.4g})"
    positions = np.concatenate([recording.positions for recording in recordings])
    low, high = np.nanmin(positions, axis=0), np.nanmax(positions, axis=0)
    sentences = [
        f"{table.file}: {_counted(len(table.frame), 'row')}",
        _counted(count, "object") + by,
        ticks,
        f"x {low[0]:.6g} to {high[0]:.6g}, y {low[1]:.6g} to {high[1]:.6g} {first.unit}",
    ]
    if first.projection is not None:
        centre = f" around {first.projection.latitude:.6g}, {first.projection.longitude:.6g}"
        sentences.append("degrees projected to metres" + (centre if count == 1 else ""))
    if times.kind:
        start = f" from {times.epoch}" if times.epoch else ""
        sentences.append(f"times are {times.kind}{start}")
    missing = int(np.isnan(positions[:, 0]).sum())
    if missing:
        sentences.append(f"{_counted(missing, 'row')} without a position")
    pieces = sum(len(recording.pieces) for recording in recordings)
    if pieces > count:
        sentences.append(f"{_counted(pieces, 'piece')} between gaps")
    if not table.headed and not roles.chosen:
        sentences.append(f"no header: columns taken as {', '.join(roles.roles)}")
    sentences += cleaning.remarks(table)
    if roles.unused:
        more = f" and {len(roles.unused) - 6} more" * (len(roles.unused) > 6)
        sentences.append(f"columns not used: {', '.join(roles.unused[:6])}{more}")
    return "; ".join(sentences)


def _counted(number: int, word: str) -> str:
    return f"{number:,} {word}{'s' * (number != 1)}"
