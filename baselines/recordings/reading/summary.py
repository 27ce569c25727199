"""One line that says what was read of a file."""

import numpy as np

from baselines.recordings.reading import cleaning
from baselines.recordings.reading.names import VOID, role_of
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import Times
from baselines.recordings.recording import Recording


def summary(table: Table, times: Times, recordings: list[Recording]) -> str:
    """Return file, rows, objects, tick, unit and extent, and what was left out or assumed."""
    first, count = recordings[0], len(recordings)
    steps = np.concatenate([np.diff(recording.times) for recording in recordings])
    tick = np.median([recording.tick for recording in recordings])
    ticks = f"tick {tick:.6g} s" if first.time_unit == "s" else "no times: a row is a tick (--tau)"
    if np.abs(steps - tick).max() > 1e-3 * tick:
        ticks += f" (steps {steps.min():.4g} to {steps.max():.4g})"
    positions = np.concatenate([recording.positions for recording in recordings])
    (left, low), (right, high) = np.nanmin(positions, axis=0), np.nanmax(positions, axis=0)
    facts = [
        f"{table.file}: {_counted(len(table.frame), 'row')}",
        _counted(count, "object") + (f" by '{table.label('object')}'" if count > 1 else ""),
        ticks,
        f"x {left:.6g} to {right:.6g}, y {low:.6g} to {high:.6g} {first.unit}",
    ]
    if first.projection is not None:
        centre = first.projection
        around = f" around {centre.latitude:.6g}, {centre.longitude:.6g}" * (count == 1)
        facts.append(f"degrees projected to metres{around}")
    if times.kind:
        facts.append(f"times are {times.kind}" + f" from {times.epoch}" * bool(times.epoch))
    if missing := int(np.isnan(positions[:, 0]).sum()):
        facts.append(f"{_counted(missing, 'row')} without a position")
    pieces = sum(len(recording.pieces) for recording in recordings)
    if pieces > count:
        facts.append(f"{_counted(pieces, 'piece')} between gaps")
    if not table.headed:
        facts.append(f"no header: columns taken as {', '.join(table.roles)}")
    facts += cleaning.remarks(table)
    unused = [
        table.label(k)
        for k, name in enumerate(table.names)
        if k not in table.roles.values() and role_of(name) not in VOID
    ]
    if unused:
        more = f" and {len(unused) - 6} more" * (len(unused) > 6)
        facts.append(f"columns not used: {', '.join(unused[:6])}{more}")
    return "; ".join(facts)


def _counted(number: int, word: str) -> str:
    return f"{number:,} {word}{'s' * (number != 1)}"
