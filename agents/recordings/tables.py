"""The tables of a tracked recording: its pieces, and its rows."""

from typing import Any

import numpy as np

from agents.recordings.tracking import TrackedRecording


def piece_table(tracked: TrackedRecording) -> dict[str, list[Any]]:
    """Columns of modes.csv. Rows are counted from 1. Cells that do not apply are empty."""
    times = tracked.recording.times
    first, end, modes, when = tracked.pieces.T
    letters, radii = tracked.of_modes(modes)
    return {
        "piece": list(range(1, len(first) + 1)),
        "first_row": (first + 1).tolist(),
        "last_row": end.tolist(),
        "begin": times[first].tolist(),
        "end": times[end - 1].tolist(),
        "mode": letters.tolist(),
        "radius": ["" if np.isnan(radius) else radius for radius in radii.tolist()],
        "decided_at": [times[row] if row >= 0 else "" for row in when.tolist()],
        "undecided": (when < 0).tolist(),
    }


def row_table(tracked: TrackedRecording) -> dict[str, Any]:
    """Columns of estimates.csv, nan where there is no number. The first three are those of a
    recording.
    """
    state = ("x", "vx", "y", "vy")
    recording = tracked.recording
    triangle = [(i, j) for i in range(4) for j in range(i, 4)]
    letters, radii = tracked.of_modes(tracked.modes)
    return {
        "t": recording.times,
        **dict(zip("xy", recording.positions.T, strict=True)),
        "mode": letters,
        "radius": radii,
        "decided": tracked.decided,
        **{
            f"p_{n.replace(' ', '_')}": tracked.probabilities[:, k]
            for k, n in enumerate(tracked.mode_names())
        },
        **{f"estimate_{name}": tracked.estimates[:, k] for k, name in enumerate(state)},
        **{f"cov_{state[i]}_{state[j]}": tracked.covariances[:, i, j] for i, j in triangle},
        **{f"residual_{axis}": tracked.residuals[:, k] for k, axis in enumerate("xy")},
    }
