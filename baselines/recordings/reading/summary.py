"""One line that says what was read of a file."""

import numpy as np

from baselines.recordings.reading import cleaning
from baselines.recordings.reading.names import VOID, role_of
from baselines.recordings.reading.table import Table
from baselines.recordings.reading.values import Times
from baselines.recordings.recording import Recording


def summary(table: Table, roles: dict[str, int], times: Times, recordings: list[Recording]) -> str:
    """Return file, rows, objects, tick, unit and extent, and what was left out or assumed."""
    first, count = recordings[0], len(recordings)
    steps = np.concatenate([np.diff(recording.times) for recording in recordings])
    tick = np.median([recording.tick for recording in recordings])
    ticks = f"tick {tick:.6g} s" if first.time_unit == "s" else "no times: a row is a tick (--tau)"
    if np.abs(steps - tick).max() > 1e-3 * tick:
        ticks += f" (steps {steps.min():.4g} to {steps.max():.4g})"
    positions = np.concatenate([recording.positions for recording in recordings])
    low, high = np.nanmin(positions, axis=0), np.nanmax(positions, axis=0)
    missing = int(np.isnan(positions[:, 0]).sum())
    pieces = sum(len(recording.pieces) for recording in recordings)
    used = {*roles.values()} | {k for k, name in enumerate(table.names) if role_of(name) in VOID}
    unused = [table.label(k) for k in range(len(table.names)) if k not in used]
    more = f" and {len(unused) - 6} more" * (len(unused) > 6)
    centre = first.projection
    around = f" around {centre.latitude:.6g}, {centre.longitude:.6g}" if centre else ""
    sentences = {
        f"{table.file}: {_counted(len(table.frame), 'row')}": True,
        _counted(count, "object")
        + (f" by '{table.label(roles['object'])}'" if count > 1 else ""): True,
        ticks: True,
        f"x {low[0]:.6g} to {high[0]:.6g}, y {low[1]:.6g} to {high[1]:.6g} {first.unit}": True,
        f"degrees projected to metres{around * (count == 1)}": centre,
        f"times are {times.kind}{f' from {times.epoch}' if times.epoch else ''}": times.kind,
        f"{_counted(missing, 'row')} without a position": missing,
        f"{_counted(pieces, 'piece')} between gaps": pieces > count,
        f"no header: columns taken as {', '.join(roles)}": not table.headed,
        **dict.fromkeys(cleaning.remarks(table), True),
        f"columns not used: {', '.join(unused[:6])}{more}": unused,
    }
    return "; ".join(sentence for sentence, true in sentences.items() if true)


def _counted(number: int, word: str) -> str:
    return f"{number:,} {word}{'s' * (number != 1)}"
