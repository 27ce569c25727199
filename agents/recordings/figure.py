"""A tracked recording of any number of rows as a figure."""

import math
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse
from matplotlib.transforms import blended_transform_factory

from agents.figures.canvas import GREY, WIDTH, new_canvas
from agents.recordings.tracked_recording import TrackedRecording
from baselines.estimation.forecast import forecast
from hybrid_env.checks import IntArray
from hybrid_env.rendering.evidence import mode_colour

# After the last row, in the picture.
FORECAST_TICKS = 5, 10, 20


def draw_recording(tracked: TrackedRecording) -> Figure:
    """Draw the ground track with the decided pieces, and over time the probabilities, the residuals
    and, where they were measured, altitudes.
    """
    points = tracked.recording.positions[tracked.recording.measured]
    width, height = np.maximum(np.ptp(points, axis=0), 1e-300)
    # [in]
    strips = 2 if tracked.vertical is None else 3
    heights = (WIDTH * float(np.clip(height / width, 0.35, 0.8)), *[1.1] * strips)
    figure = new_canvas(sum(heights) + 1.2 + 0.7 * strips)
    ground, ribbon, residuals, *climbs = figure.subplots(1 + strips, 1, height_ratios=heights)
    residuals.sharex(ribbon)
    _draw_ground(ground, tracked)
    _draw_probabilities(ribbon, tracked)
    _draw_residuals(residuals, tracked)
    times = tracked.recording.times[tracked.modes >= 0]
    ribbon.set_xlim(times[0] - 0.5 * tracked.model.tau, times[-1] + 0.5 * tracked.model.tau)
    ribbon.tick_params(labelbottom=False)
    for axes in climbs:
        residuals.tick_params(labelbottom=False)
        axes.sharex(ribbon)
        _draw_altitudes(axes, tracked)
    [residuals, *climbs][-1].set_xlabel(f"t [{tracked.recording.time_unit}]")
    modes = [
        Line2D([], [], color=colour, linewidth=2.5, label=name)
        for colour, name in zip(mode_colours(tracked), mode_words(tracked), strict=True)
    ]
    marks = ground.get_legend_handles_labels()[0]
    figure.legend(handles=[*modes, *marks], loc="outside lower center", ncols=2, frameon=False)
    return figure


def _draw_altitudes(axes: Any, tracked: TrackedRecording) -> None:
    recording, vertical = tracked.recording, tracked.vertical
    assert recording.altitudes is not None
    assert vertical is not None
    shown = thinned(np.flatnonzero(np.isfinite(recording.altitudes)))
    axes.plot(recording.times[shown], recording.altitudes[shown], ".", color=GREY, markersize=2)
    for first, end in vertical.pieces.tolist():
        rows = [first, end - 1]
        axes.plot(recording.times[rows], vertical.altitudes[rows], color="black", linewidth=1.2)
    axes.set_ylabel(f"altitude [{recording.unit}]")
    axes.set_title("Altitudes and the line of their climb rates", fontsize=10)


def mode_words(tracked: TrackedRecording) -> list[str]:
    """Return the name of every mode in words, with the radius of a turn."""
    unit = tracked.recording.unit
    return [
        f"{mode.type}, radius {abs(mode.signed_radius):.3g} {unit}"
        if mode.signed_radius
        else mode.type
        for mode in tracked.model.all_modes
    ]


def mode_colours(tracked: TrackedRecording) -> list[str]:
    """Return the colour of every mode."""
    modes = tracked.model.all_modes
    return [mode_colour(mode, modes) for mode in range(len(modes))]


def thinned(rows: IntArray, most: int = 5000) -> IntArray:
    """Return at most so many rows; Agg raises OverflowError for very long lines."""
    return rows[:: max(-(-len(rows) // most), 1)]


def mode_lines(tracked: TrackedRecording, most: int = 5000) -> list[tuple[int, IntArray]]:
    """Return mode and rows of the line of each piece, joined to the piece before; of `most` rows
    in all.

    Every piece keeps its first and last row, so that short pieces stay visible.
    """
    every = -(-len(tracked.modes) // most)
    after_gap = {piece.first for piece in tracked.grid.pieces}
    lines = []
    for first, end, mode, _ in tracked.pieces.tolist():
        begin = first if first in after_gap else first - 1
        lines.append((mode, np.append(np.arange(begin, end - 1, every), end - 1)))
    return lines


def _draw_ground(axes: Any, tracked: TrackedRecording) -> None:
    recording, unit = tracked.recording, tracked.recording.unit
    rows = thinned(np.flatnonzero(recording.measured))
    points = recording.positions[rows].T
    axes.plot(*points, ".", color=GREY, markersize=2, alpha=0.5, zorder=1, label="measurements")
    colours = mode_colours(tracked)
    positions = tracked.estimates[:, ::2]
    lines = mode_lines(tracked)
    axes.add_collection(
        LineCollection(
            [positions[rows] for _, rows in lines],
            colors=[colours[mode] for mode, _ in lines],
            linewidths=1.8,
        )
    )
    first = tracked.pieces[:, 0]
    # More marks would hide the track.
    marked = positions[first if len(first) <= 60 else first[:0]]
    axes.plot(*marked.T, "o", color="black", markerfacecolor="white", label="new piece")
    axes.plot(*positions[first[0]], "s", color="black", label="first row")
    _draw_forecast(axes, tracked)
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    axes.set(title=f"{recording.name}: decided pieces", xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    axes.grid(alpha=0.25)


def _draw_forecast(axes: Any, tracked: TrackedRecording) -> None:
    """Draw forecasts of the position, `FORECAST_TICKS` after the last row with an estimate, as
    ellipses that hold 95 % of a normal distribution.
    """
    known = np.flatnonzero(np.isfinite(tracked.covariances).all(axis=(1, 2)))
    if not known.size:
        return
    row = known[-1]
    means, covariances = forecast(
        tracked.estimates[row],
        tracked.covariances[row],
        tracked.probabilities[row],
        tracked.model,
        tracked.model.tau * np.array(FORECAST_TICKS),
    )
    label = f"95 % after {', '.join(map(str, FORECAST_TICKS))} ticks"
    for mean, covariance in zip(means, covariances, strict=True):
        variances, vectors = np.linalg.eigh(covariance)
        width, height = 2.0 * np.sqrt(-2.0 * math.log(0.05) * variances.clip(0.0))
        angle = math.degrees(math.atan2(vectors[1, 0], vectors[0, 0]))
        ellipse = Ellipse(mean, width, height, angle=angle, fill=False, color="black", label=label)
        # A wide one does not change what is shown.
        axes.add_artist(ellipse)
        # The legend names the first one.
        label = ""
    axes.update_datalim(means)


def _draw_probabilities(axes: Any, tracked: TrackedRecording) -> None:
    """Draw the probabilities as stacked areas, and above them the decided modes."""
    times, colours = tracked.recording.times, mode_colours(tracked)
    for first, end in tracked.recording.pieces:
        rows = np.arange(first, end, -(-len(times) // 5000))
        axes.stackplot(times[rows], tracked.probabilities[rows].T, colors=colours, linewidth=0.0)
    above = blended_transform_factory(axes.transData, axes.transAxes)
    first, end, modes, _ = tracked.pieces.T
    begins = times[first] - 0.5 * tracked.model.tau
    spans = np.stack([begins, times[end - 1] + 0.5 * tracked.model.tau - begins], axis=1)
    facecolors = [colours[mode] for mode in modes]
    axes.broken_barh(spans, (1.04, 0.12), facecolors=facecolors, transform=above, clip_on=False)
    low, high = tracked.moments.T
    # A live rule knows none.
    bands = np.stack([low, high - low], axis=1)[np.isfinite(low)]
    axes.broken_barh(bands, (1.0, 0.04), facecolors="black", transform=above, clip_on=False)
    axes.set(ylim=(0.0, 1.0), ylabel="probability")
    title = "Decided modes (bar) and their probabilities"
    title = title if tracked.live else f"{title};\n95 % interval of each begin (black)"
    axes.set_title(title, pad=20.0, fontsize=10)


def _draw_residuals(axes: Any, tracked: TrackedRecording) -> None:
    lengths = np.hypot(*tracked.residuals.T)
    given = np.flatnonzero(~np.isnan(lengths))
    shown = thinned(given)
    axes.plot(tracked.recording.times[shown], lengths[shown], ".", color="black", markersize=2)
    # The lengths of a normalised innovation in two dimensions that are exceeded so often.
    median, far = (math.sqrt(-2.0 * math.log(exceeded)) for exceeded in (0.5, 0.001))
    for length, style in ((median, ":"), (far, "--")):
        axes.axhline(length, color="black", linestyle=style, linewidth=1.0)
    largest = float(np.quantile(lengths[given], 0.995)) if given.size else 0.0
    axes.set(ylim=(0.0, max(1.2 * far, 1.1 * largest)), ylabel="residual")
    lines = (
        "Residuals in standard deviations; if the model holds,",
        "half are below the dotted line, 99.9 % below the dashed",
    )
    axes.set_title("\n".join(lines), fontsize=10)
