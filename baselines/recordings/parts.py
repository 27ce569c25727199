"""Parts of a recording, side by side in the lanes of a block, for `imm_pass`."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.imm_pass import Chunks, make_chunks
from baselines.recordings.ticks import TickGrid
from hybrid_env.core.records import LANES

FloatArray = NDArray[np.float64]

FIT_TICKS = 4096
"""Ticks that are used; a longer recording is represented by parts of it, evenly spread."""

SHORTEST_PART = 256
"""Ticks; every part forgets the velocity of the one before, and with it what it says about Q."""


def fit_chunks(grid: TickGrid, scale: float, lengths: Sequence[int] = (), ticks: int = FIT_TICKS) -> Chunks:
    """Return parts of a recording, evenly spread, in units of `scale`, each near its first measurement."""
    length = max(-(-min(grid.total, ticks) // LANES), SHORTEST_PART)
    places = cut(grid, length)
    wanted = max(ticks // length, LANES)
    if len(places) > wanted:
        places = [places[k] for k in np.linspace(0, len(places) - 1, wanted).round().astype(int)]
    places.sort(key=lambda place: place[2] - place[1])
    return chunks_at(grid, places, scale, lengths)


def cut(grid: TickGrid, length: int) -> list[tuple[int, int, int]]:
    """Return stretch, first tick and end of parts of a recording of about a length."""
    places = []
    for k, stretch in enumerate(grid.stretches):
        number = max(round(len(stretch.measurements) / length), 1)
        borders = np.linspace(0, len(stretch.measurements), number + 1).astype(int).tolist()
        places += [(k, a, b) for a, b in pairwise(borders)]
    return places


def chunks_at(
    grid: TickGrid, places: list[tuple[int, int, int]], scale: float, lengths: Sequence[int]
) -> Chunks:
    """Return the parts at `places`, see `cut`; with known switches if lengths are given."""
    parts = [_from_first(grid.stretches[k].measurements[a:b]) / scale for k, a, b in places]
    if not lengths:
        return make_chunks(parts)
    begins = np.zeros(grid.total, np.bool_)
    begins[np.cumsum([0, *lengths[:-1]])] = True
    return make_chunks(parts, [begins[a:b] for _, a, b in places])


def _from_first(part: FloatArray) -> FloatArray:
    """Return positions relative to the first measurement."""
    measured = np.flatnonzero(~np.isnan(part[:, 0]))
    return part - part[measured[0]] if measured.size else part
