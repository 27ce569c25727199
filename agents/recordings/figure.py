"""The picture of a tracked recording: the way in the plane, and the active mode over time."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from baselines.recordings.ate import Tracks
from hybrid_env.rendering.modes import mode_colour, mode_name

CROWDED = 100
"""Pieces beyond which marks of the usual size would hide the modes."""

_GREY, _LINE_POINTS = "#9a9a9a", 5000


def draw_track(
    times: NDArray[np.float64],
    measurements: NDArray[np.float64],
    lengths: Sequence[int],
    tracks: Tracks,
    radii: Sequence[float],
) -> Figure:
    """The way in the plane, and below it the active mode over time.

    Args:
        times: (T,) [s].
        measurements: (T, 2) [m].
        lengths: (K,) ticks of the pieces.
        tracks: of a single run.
        radii: (n,) of the bank [m].
    """
    used = np.unique(np.concatenate([tracks.modes, tracks.decided])).tolist()
    points = np.concatenate([measurements, tracks.estimates[:, [0, 2]]])
    width, height = np.maximum(np.ptp(points, axis=0), 1e-9)
    heights = (8.0 * float(np.clip(height / width, 0.3, 0.9)), 0.5 + 0.3 * len(used))  # [in]
    figure = Figure(figsize=(10.0, sum(heights) + 1.2), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, 1, height_ratios=heights)
    _draw_way(above, measurements, lengths, tracks, radii)
    _draw_modes(below, times, lengths, tracks, radii, used)

    above.plot([], [], ".", color=_GREY, markersize=6, label="measured")
    for mode in used:
        above.plot([], [], color=mode_colour(mode, radii), linewidth=2.5, label=mode_name(mode, radii))
    handles = [*above.get_legend_handles_labels()[0], *below.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside right upper", frameon=False)
    return figure


def _draw_way(
    axes: Any,
    measurements: NDArray[np.float64],
    lengths: Sequence[int],
    tracks: Tracks,
    radii: Sequence[float],
) -> None:
    size = 3.0 if len(lengths) > CROWDED else 7.0
    axes.plot(*measurements.T, ".", color=_GREY, markersize=3, alpha=0.6, zorder=1)
    positions = tracks.estimates[:, [0, 2]]
    lines, colours = [], []
    for first, end in _mode_runs(tracks.modes):
        colour = mode_colour(int(tracks.modes[first]), radii)
        for k in range(first, end, _LINE_POINTS):  # Agg refuses very long lines
            lines.append(positions[max(k - 1, 0) : min(k + _LINE_POINTS, end)])
            colours.append(colour)
    axes.add_collection(
        LineCollection(lines, colors=colours, linewidths=size / 3.5, capstyle="round", zorder=2)
    )
    black: dict[str, Any] = {"linestyle": "none", "markeredgecolor": "black", "zorder": 3}
    axes.plot(*positions[0], marker="s", markerfacecolor="black", markersize=7, label="first tick", **black)
    switched = np.flatnonzero(np.diff(tracks.decided) != 0)
    ends = np.cumsum(lengths)[switched] - 1
    if ends.size:
        axes.plot(
            *positions[ends].T, marker="o", markerfacecolor="white", markersize=size, label="switch", **black
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.grid(alpha=0.25)


def _draw_modes(
    axes: Any,
    times: NDArray[np.float64],
    lengths: Sequence[int],
    tracks: Tracks,
    radii: Sequence[float],
    used: list[int],
) -> None:
    rows = {mode: len(used) - 1 - k for k, mode in enumerate(used)}  # straight on top
    step = times[1] - times[0] if len(times) > 1 else 1.0
    bars: dict[int, list[tuple[float, float]]] = {mode: [] for mode in used}
    for first, end in _mode_runs(tracks.modes):
        bars[int(tracks.modes[first])].append((times[first] - step / 2.0, (end - first) * step))
    for mode, spans in bars.items():
        axes.broken_barh(spans, (rows[mode] - 0.3, 0.6), facecolors=mode_colour(mode, radii), zorder=2)
    ends = np.cumsum(lengths)
    if len(lengths) <= CROWDED:
        dashed: dict[str, Any] = {"color": _GREY, "linewidth": 0.8, "linestyle": (0, (4, 3)), "zorder": 1}
        for k, end in enumerate(ends[:-1]):
            label = "" if k else "possible switch"
            axes.axvline(times[end] - step / 2.0, label=label, **dashed)
    height = np.array([rows[mode] + 0.38 for mode in tracks.decided.tolist()])
    decided = ~tracks.undecided
    width = 0.6 if len(lengths) > CROWDED else 2.0
    marks: dict[str, Any] = {
        "linestyle": "none", "color": "black", "markersize": 8, "markeredgewidth": width, "zorder": 3,
        "clip_on": False,
    }  # fmt: skip
    if decided.any():
        when = times[(ends - np.asarray(lengths) + tracks.ticks - 1)[decided]]
        axes.plot(when, height[decided], marker="|", label="decision", **marks)
    if not decided.all():
        when = times[(ends - 1)[~decided]]
        axes.plot(when, height[~decided], marker="x", label="no decision", **marks)
    axes.set_yticks(list(rows.values()), [mode_name(mode, radii) for mode in rows])
    axes.set_ylim(-0.5, len(used) - 0.3)
    axes.set_xlim(times[0] - step / 2.0, times[-1] + step / 2.0)
    axes.set(xlabel="t [s]", ylabel="mode")


def _mode_runs(modes: NDArray[np.int64]) -> list[tuple[int, int]]:
    """(first, end) of the stretches of equal mode."""
    borders = [0, *(np.flatnonzero(np.diff(modes)) + 1).tolist(), len(modes)]
    return list(itertools.pairwise(borders))
