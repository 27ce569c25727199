"""Interactive map of a tracked recording as one HTML file that needs no network."""

from pathlib import Path
from typing import Any

import numpy as np

from agents.interface.output_files import atomic_file
from agents.recordings.figure import GREY, mode_colours, mode_lines
from agents.recordings.tracked import TrackedRecording
from hybrid_env.checks import ArgumentError

MAX_POINTS = 100_000
"""Points that a browser draws without delay."""


def check_plotly() -> Any:
    """Return the module of plotly.

    Raises:
        ArgumentError: it is not installed.
    """
    try:
        import plotly.graph_objects as module
    except ImportError:
        raise ArgumentError("--html needs the extra 'html': pip install 'hybrid-track[html]'") from None
    return module


def write_map(path: Path, tracked: TrackedRecording) -> None:
    """Write the ground track with decided modes; time, mode and probability appear under the pointer.

    Raises:
        ArgumentError: plotly is not installed, or the file cannot be written.
    """
    plotly = check_plotly()
    recording, names, colours = tracked.recording, tracked.mode_names(), mode_colours(tracked)
    figure = plotly.Figure()
    rows = np.flatnonzero(recording.measured)
    rows = rows[:: max(-(-len(rows) // MAX_POINTS), 1)]
    figure.add_scattergl(
        x=recording.positions[rows, 0], y=recording.positions[rows, 1], mode="markers", name="measurements",
        marker={"color": GREY, "size": 4, "opacity": 0.5}, hoverinfo="skip",
    )  # fmt: skip
    lines = mode_lines(tracked, MAX_POINTS)
    for mode, name in enumerate(names):
        of_mode = [np.append(rows, -1) for line_mode, rows in lines if line_mode == mode]
        if not of_mode:
            continue
        joined = np.concatenate(of_mode)  # -1 interrupts the line
        gap = joined < 0
        x, y = (np.where(gap, np.nan, tracked.estimates[joined, k]) for k in (0, 2))
        shown = np.stack([recording.times[joined], tracked.probabilities[joined, mode]], axis=1)
        figure.add_scattergl(
            x=x, y=y, mode="lines", name=name, line={"color": colours[mode], "width": 4}, customdata=shown,
            hovertemplate=f"{name}<br>t = %{{customdata[0]:.6g}} {recording.time_unit}"
            "<br>p = %{customdata[1]:.2f}<br>x = %{x:.6g}, y = %{y:.6g}<extra></extra>",
        )  # fmt: skip
    figure.update_layout(
        title=f"{recording.name}: decided by {tracked.decider}", template="plotly_white",
        xaxis_title=f"x [{recording.unit}]", yaxis_title=f"y [{recording.unit}]", hovermode="closest",
        yaxis={"scaleanchor": "x", "scaleratio": 1},
    )  # fmt: skip
    with atomic_file(path) as part:
        figure.write_html(part, include_plotlyjs=True, full_html=True)
