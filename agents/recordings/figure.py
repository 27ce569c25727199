"""Figure of a tracked recording: trajectory with decisions in the plane, and active mode over time."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from agents.interface.curve_labels import label_curves
from baselines.recordings.ate import Tracks
from hybrid_env.rendering.modes import mode_colour, mode_name

MAX_NUMBERED = 20
"""Up to this many pieces, decisions are numbered."""

MIN_NUMBERED_SHARE = 0.025
"""Pieces shorter than this share of the recording have no number on the time axis."""

MAX_GUIDES = 40
"""Up to this many pieces, thin lines mark the possible switches over time."""

MAX_LINE_POINTS = 5000
"""Agg raises OverflowError for very long lines; longer ones are split."""

GREY, BLACK, YELLOW = "#9a9a9a", "#000000", "#f0e442"


def draw_track(
    times: NDArray[np.float64],
    measurements: NDArray[np.float64],
    lengths: Sequence[int],
    tracks: Tracks,
    radii: Sequence[float],
) -> Figure:
    """Draw the estimated trajectory and, below it, the active mode over time.

    Args:
        times: (T,) times of the measurements [s].
        measurements: (T, 2) measured coordinates [m].
        lengths: (K,) ticks of the pieces.
        tracks: result of `baselines.track` for a single run.
        radii: (n,) turn radii of the bank [m].

    Returns:
        The figure, with an Agg canvas.
    """
    used = np.unique(np.concatenate([tracks.modes, tracks.decided])).tolist()
    points = np.concatenate([measurements, tracks.estimates[:, [0, 2]]])
    width, height = np.maximum(np.ptp(points, axis=0), 1e-9)
    heights = (8.0 * float(np.clip(height / width, 0.3, 0.9)), 0.5 + 0.3 * len(used))  # [in]
    figure = Figure(figsize=(10.0, sum(heights) + 1.6), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, 1, height_ratios=heights)
    size = float(np.clip(40.0 / np.sqrt(len(lengths)), 3.0, 7.0))  # of the markers [pt]
    marks = _draw_trajectory(above, measurements, lengths, tracks, radii, size)
    _draw_modes(below, times, lengths, tracks, radii, used, size)
    handles = [
        Line2D([], [], color=GREY, marker=".", linestyle="none", markersize=6, label="measurements"),
        *(
            Line2D([], [], color=mode_colour(mode, radii), linewidth=2.5, label=mode_name(mode, radii))
            for mode in used
        ),
        *above.get_legend_handles_labels()[0],
    ]
    figure.legend(
        handles=handles, loc="outside right upper", frameon=False, alignment="left",
        title="S: straight\nL, R: left, right turn",
    )  # fmt: skip
    if len(lengths) <= MAX_NUMBERED:
        label_curves(above, marks)
    return figure


def _draw_trajectory(
    axes: Any,
    measurements: NDArray[np.float64],
    lengths: Sequence[int],
    tracks: Tracks,
    radii: Sequence[float],
    size: float,
) -> list[tuple[Line2D, str]]:
    """Draw measurements, estimate and decisions; return one mark and its number for each piece."""
    axes.plot(*measurements.T, ".", color=GREY, markersize=3, alpha=0.6, zorder=1)
    positions = tracks.estimates[:, [0, 2]]
    lines, colours = [], []
    for first, end in _mode_runs(tracks.modes):
        colour = mode_colour(int(tracks.modes[first]), radii)
        for k in range(first, end, MAX_LINE_POINTS):
            lines.append(positions[max(k - 1, 0) : min(k + MAX_LINE_POINTS, end)])
            colours.append(colour)
    width = 1.0 + size / 7.0
    numbered = len(lengths) <= MAX_NUMBERED
    if numbered:  # the labels avoid lines, not collections
        for line, colour in zip(lines, colours, strict=True):
            axes.plot(*line.T, color=colour, linewidth=width, zorder=2)
    else:
        axes.add_collection(
            LineCollection(lines, colors=colours, linewidths=width, capstyle="round", zorder=2)
        )
    axes.plot(*positions[0], "s", color=BLACK, markersize=6, zorder=5, label="first tick")
    decisions = positions[_decision_indices(lengths, tracks)]
    _draw_marks(axes, decisions, positions[np.cumsum(lengths)[:-1] - 1], tracks.undecided, size)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(title="Estimated trajectory", xlabel="x [m]", ylabel="y [m]")
    axes.grid(alpha=0.25)
    if not numbered:
        return []
    # `label_curves` needs one line for each label; these are transparent
    return [
        (axes.plot(*point, "o", color=BLACK, alpha=0.0, markersize=size)[0], str(number))
        for number, point in enumerate(decisions, start=1)
    ]


def _draw_marks(
    axes: Any,
    decisions: NDArray[np.float64],
    switches: NDArray[np.float64],
    undecided: NDArray[np.bool_],
    size: float,
) -> None:
    """Mark decisions and possible switches.

    Args:
        axes: axes to draw into.
        decisions: (K, 2) points of the decisions, or of the ends of pieces without one.
        switches: (K - 1, 2) points of the possible switches.
        undecided: (K,) True for pieces without a decision.
        size: size of the markers [pt].
    """
    style: dict[str, Any] = {"color": BLACK, "markeredgewidth": size / 6.0, "zorder": 4, "clip_on": False}
    if len(switches):
        axes.plot(*switches.T, "D", markersize=0.5 * size, label="possible switch", **style)
    if not undecided.all():
        points = decisions[~undecided].T
        axes.plot(*points, "o", markerfacecolor="white", markersize=size, label="decision", **style)
    if undecided.any():
        points = decisions[undecided].T
        axes.plot(*points, "^", markerfacecolor=YELLOW, markersize=1.2 * size, label="no decision", **style)


def _draw_modes(
    axes: Any,
    times: NDArray[np.float64],
    lengths: Sequence[int],
    tracks: Tracks,
    radii: Sequence[float],
    used: list[int],
    size: float,
) -> None:
    """Draw the active mode over time as bars, one row for each mode, with the marks of `_draw_marks`."""
    rows = {mode: len(used) - 1 - k for k, mode in enumerate(used)}  # straight in the top row
    step = times[1] - times[0] if len(times) > 1 else 1.0
    bars: dict[int, list[tuple[float, float]]] = {mode: [] for mode in used}
    for first, end in _mode_runs(tracks.modes):
        bars[int(tracks.modes[first])].append((times[first] - step / 2.0, (end - first) * step))
    for mode, spans in bars.items():
        axes.broken_barh(spans, (rows[mode] - 0.3, 0.6), facecolors=mode_colour(mode, radii), zorder=2)
    ends, bottom = np.cumsum(lengths), -0.6
    decisions = np.column_stack(
        [times[_decision_indices(lengths, tracks)], [rows[mode] for mode in tracks.decided.tolist()]]
    )
    switches = np.column_stack([times[ends[:-1]] - step / 2.0, np.full(len(ends) - 1, bottom)])
    _draw_marks(axes, decisions, switches, tracks.undecided, size)
    if len(lengths) <= MAX_GUIDES:
        for end in ends[:-1]:
            axes.axvline(times[end] - step / 2.0, color="0.85", linewidth=0.8, zorder=0)
    if len(lengths) <= MAX_NUMBERED:
        top = axes.secondary_xaxis("top")
        top.set_xlabel("piece")
        centres = (times[ends - np.asarray(lengths)] + times[ends - 1]) / 2.0
        wide = np.flatnonzero(np.asarray(lengths) >= MIN_NUMBERED_SHARE * ends[-1])
        top.set_xticks(centres[wide], [str(number) for number in wide + 1])
        top.tick_params(length=0)
    axes.set_yticks(list(rows.values()), [mode_name(mode, radii) for mode in rows])
    axes.set_ylim(bottom, len(used) - 0.4)
    axes.set_xlim(times[0] - step / 2.0, times[-1] + step / 2.0)
    axes.set(title="Active mode", xlabel="t [s]", ylabel="mode")


def _decision_indices(lengths: Sequence[int], tracks: Tracks) -> NDArray[np.int64]:
    """Index of the decision tick of each piece, or of its last tick if there is no decision, (K,)."""
    return np.asarray(np.cumsum(lengths) - np.asarray(lengths) + tracks.ticks - 1)


def _mode_runs(modes: NDArray[np.int64]) -> list[tuple[int, int]]:
    """First tick and end of each interval of constant mode, counted from 0."""
    borders = [0, *(np.flatnonzero(np.diff(modes)) + 1).tolist(), len(modes)]
    return list(itertools.pairwise(borders))
