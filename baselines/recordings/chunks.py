"""Chunks of a recording, side by side in the lanes of a block, and what a pass of the bank records of them.

The pieces of a recording between gaps are cut into chunks of about equal length, as `imm_pass` needs them.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.imm_pass import Chunks, PassOutput, imm_pass, make_chunks, prepare_pass
from baselines.recordings.ticks import TickGrid
from hybrid_env.core.banks.bank import FilterModel, bank_arrays
from hybrid_env.core.banks.imm import ImmBank
from hybrid_env.core.records import LANES

FloatArray = NDArray[np.float64]

FIT_TICKS = 4096
"""Ticks that are used; a longer recording is represented by chunks of it, evenly spread."""

SHORTEST_CHUNK = 256
"""Ticks; every chunk forgets the velocity of the one before, and with it what it says about Q."""


def fit_chunks(grid: TickGrid, scale: float, lengths: Sequence[int] = ()) -> Chunks:
    """Return chunks of a recording, evenly spread, in units of `scale`, each near its first measurement."""
    length = max(-(-min(grid.total, FIT_TICKS) // LANES), SHORTEST_CHUNK)
    places = cut(grid, length)
    wanted = max(FIT_TICKS // length, LANES)
    if len(places) > wanted:
        places = [places[k] for k in np.linspace(0, len(places) - 1, wanted).round().astype(int)]
    places.sort(key=lambda place: place[2] - place[1])
    return chunks_at(grid, places, scale, lengths)


def cut(grid: TickGrid, length: int) -> list[tuple[int, int, int]]:
    """Return piece, first tick and end of chunks of a recording of about a length."""
    places = []
    for k, piece in enumerate(grid.pieces):
        number = max(round(len(piece.measurements) / length), 1)
        borders = np.linspace(0, len(piece.measurements), number + 1).astype(int).tolist()
        places += [(k, a, b) for a, b in pairwise(borders)]
    return places


def chunks_at(
    grid: TickGrid, places: list[tuple[int, int, int]], scale: float, lengths: Sequence[int]
) -> Chunks:
    """Return the chunks at `places`, see `cut`; with known switches if lengths are given."""
    values = [_from_first(grid.pieces[k].measurements[a:b]) / scale for k, a, b in places]
    if not lengths:
        return make_chunks(values)
    begins = np.zeros(grid.total, np.bool_)
    begins[np.cumsum([0, *lengths[:-1]])] = True
    return make_chunks(values, [begins[a:b] for _, a, b in places])


def recorded_pass(chunks: Chunks, radii: FloatArray, model: FilterModel) -> PassOutput:
    """Return innovations and probabilities of the modes of chunks at every tick, NaN where there are none.

    Args:
        chunks: measurements; their block holds the last estimates afterwards.
        radii: (n,) turn radii.
        model: tick, variances and transition probabilities.
    """
    shape, modes = chunks.measurements.shape[:2], 2 * len(radii) + 1
    output = PassOutput(np.full((*shape, 2, LANES), np.nan), np.full((*shape, modes, LANES), np.nan))
    prepare_pass()
    imm_pass(chunks, bank_arrays(ImmBank, len(radii)), radii, model, output)
    return output


def _from_first(values: FloatArray) -> FloatArray:
    """Return positions relative to the first measurement."""
    measured = np.flatnonzero(~np.isnan(values[:, 0]))
    return values - values[measured[0]] if measured.size else values
