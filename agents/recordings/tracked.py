"""What is known of a recording after tracking, row by row."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.consistency import Consistency
from baselines.recordings.decisions import TickDecisions
from baselines.recordings.model_fit import TrackModel
from baselines.recordings.recording import Recording
from baselines.recordings.ticks import TickGrid
from hybrid_env.checks import BoolArray, FloatArray, IntArray

STATE = ("x", "vx", "y", "vy")
NO_ROW = -1


@dataclass(frozen=True, eq=False)
class TrackedRecording:
    """A recording of n rows with its M modes, in its own units.

    Rows before the first and after the last measurement, and rows inside of gaps, have mode -1 and NaN.

    Attributes:
        recording: as it was read.
        model: noise, radii and durations that the filters assume, and which of them were estimated.
        decider: its name.
        modes: (n,) 0 straight, 1 .. left turns and then right turns, in the order of `model.radii`.
        decided: (n,) False before a mode was decided: at the start, and with known switches in each piece.
        probabilities: (n, M) of the modes at each row, from the measurements up to it.
        estimates: (n, 4) [x, vx, y, vy] from the measurements up to the row.
        covariances: (n, 4, 4) of the estimates.
        residuals: (n, 2) normalised innovations, N(0, 1) if the model holds; NaN without one.
        pieces: (K, 4) first row, end, mode and row of the decision of each piece, counted from 0; -1 for a
            piece without a decision.
        consistency: agreement of model and measurements.
        tau: tick of the filters.
        shared: number of rows whose tick is that of another row, with which they are averaged.
        moved: root mean square of the times by which rows were moved to their ticks, over the tick.
        outliers: number of measurements that were not used, because they are far from their neighbours.
    """

    recording: Recording
    model: TrackModel
    decider: str
    modes: IntArray
    decided: BoolArray
    probabilities: FloatArray
    estimates: FloatArray
    covariances: FloatArray
    residuals: FloatArray
    pieces: IntArray
    consistency: Consistency
    tau: float
    shared: int
    moved: float
    outliers: int

    @property
    def warnings(self) -> list[str]:
        """Plain sentences about what does not fit."""
        return self.consistency.warnings(self.model)

    def mode_names(self) -> list[str]:
        """Names of the modes: S, L, R, with the radius if there are several."""
        radii = self.model.radii
        shown = [f" {radius:.4g}" if len(radii) > 1 else "" for radius in radii]
        return ["S", *(f"{turn}{text}" for turn in "LR" for text in shown)]

    def of_modes(self, modes: IntArray) -> tuple[NDArray[Any], FloatArray]:
        """Return the letters S, L and R and the radii of modes, empty and NaN where there is none."""
        radii = self.model.radii
        letters = np.array(["S", *"L" * len(radii), *"R" * len(radii), ""])
        return letters[modes], np.array([np.nan, *radii, *radii, np.nan])[modes]


def row_results(
    recording: Recording, grid: TickGrid, model: TrackModel, decider: str, decisions: Sequence[TickDecisions],
    consistency: Consistency, outliers: int,
) -> TrackedRecording:  # fmt: skip
    """Return the results of the ticks of each piece at the rows of a recording."""
    rows, M, pieces = len(recording.times), 2 * len(model.radii) + 1, []
    shapes = {"probabilities": (M,), "estimates": (4,), "covariances": (4, 4), "residuals": (2,)}
    arrays: dict[str, Any] = {"modes": np.full(rows, NO_ROW), "decided": np.zeros(rows, np.bool_)}
    arrays |= {name: np.full((rows, *shape), np.nan) for name, shape in shapes.items()}
    for piece, found, innovations in zip(grid.pieces, decisions, consistency.innovations, strict=True):
        rows_of = slice(piece.first, piece.end)
        for name in ("modes", "decided", "probabilities", "estimates", "covariances"):
            arrays[name][rows_of] = getattr(found, name)[piece.ticks]
        arrays["estimates"][rows_of, 0::2] += piece.late[:, None] * arrays["estimates"][rows_of, 1::2]
        arrays["residuals"][rows_of] = innovations[piece.ticks]
        table = found.pieces.copy()
        for column in (0, 1, 3):
            at = np.searchsorted(piece.ticks, found.pieces[:, column])
            table[:, column] = np.minimum(piece.first + at, piece.end)
        table[found.pieces[:, 3] < 0, 3] = -1
        pieces.append(table[table[:, 1] > table[:, 0]])  # a piece between two rows has none
    arrays["residuals"][~recording.measured] = np.nan
    return TrackedRecording(
        recording=recording, model=model, decider=decider, pieces=np.concatenate(pieces), outliers=outliers,
        consistency=consistency, tau=grid.tau, shared=grid.shared, moved=grid.moved, **arrays,
    )  # fmt: skip


def piece_table(tracked: TrackedRecording) -> dict[str, list[Any]]:
    """Columns of modes.csv. Rows are counted from 1. Cells that do not apply are empty."""
    times = tracked.recording.times
    first, end, modes, when = tracked.pieces.T
    letters, radii = tracked.of_modes(modes)
    return {
        "piece": list(range(1, len(first) + 1)), "first_row": (first + 1).tolist(), "last_row": end.tolist(),
        "begin": times[first].tolist(), "end": times[end - 1].tolist(), "mode": letters.tolist(),
        "radius": ["" if np.isnan(radius) else radius for radius in radii.tolist()],
        "decided_at": [times[row] if row >= 0 else "" for row in when.tolist()], "undecided": (when < 0).tolist(),
    }  # fmt: skip


def row_table(tracked: TrackedRecording) -> dict[str, Any]:
    """Columns of estimates.csv, nan where there is no number. The first three are those of a recording."""
    recording = tracked.recording
    triangle = [(i, j) for i in range(4) for j in range(i, 4)]
    letters, radii = tracked.of_modes(tracked.modes)
    return {
        "t": recording.times, **dict(zip("xy", recording.positions.T, strict=True)),
        "mode": letters, "radius": radii, "decided": tracked.decided,
        **{f"p_{n.replace(' ', '_')}": tracked.probabilities[:, k] for k, n in enumerate(tracked.mode_names())},
        **{f"estimate_{name}": tracked.estimates[:, k] for k, name in enumerate(STATE)},
        **{f"cov_{STATE[i]}_{STATE[j]}": tracked.covariances[:, i, j] for i, j in triangle},
        **{f"residual_{axis}": tracked.residuals[:, k] for k, axis in enumerate("xy")},
    }  # fmt: skip
