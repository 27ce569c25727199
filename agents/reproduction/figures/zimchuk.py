"""Figure of the filters of Zimchuk & Kankin: position error over time, and RMSE on each leg."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from agents.figures.canvas import GREY, paper_figure
from baselines.papers import zimchuk
from baselines.papers.reproduction import Cell, Reproduction

STYLES = {
    "adaptive, as published": ("#AA3377", "-", "o"),
    "adaptive, corrected": ("#CCBB44", "-", "s"),
    "Kalman, sigma_w = 4.64": ("#000000", "--", "v"),
    "Kalman, sigma_w = 20": ("#4477AA", "-", "D"),
    "Kalman, sigma_w = 60": ("#4D4D4D", ":", "^"),
    "measurements": (GREY, "-", "x"),
}
"""Colour, line and marker of each filter."""

LIMITS = (1.2, 50.0)  # of the error axes [m]


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figure by its file name."""
    figure, (time_axes, leg_axes) = paper_figure(
        f"{result.paper}: uniform motion and two manoeuvres, R = {zimchuk.VARIANCE:g} m²", (14.0, 5.6), (1.4, 1.0)
    )
    _draw_errors(time_axes, result)
    _draw_legs(leg_axes, result)
    return {"zimchuk.png": figure}


def _label(name: str) -> str:
    return name.replace("sigma_w = ", "") + (" m/s²" if "sigma_w" in name else "")


def _error_axes(axes: Any, title: str) -> None:
    axes.set(title=title, yscale="log", ylim=LIMITS, ylabel="RMSE of the position on an axis [m]")
    axes.set_yticks([1.5, 2, 3, 5, 10, 20, 40], ["1.5", "2", "3", "5", "10", "20", "40"])
    axes.minorticks_off()
    axes.grid(axis="y", alpha=0.25)


def _draw_errors(axes: Any, result: Reproduction) -> None:
    """RMSE over all runs at each time."""
    flights = result.examples["flights"]
    for name, (colour, style, _) in STYLES.items():
        errors = result.examples[name] - flights.truth[:, None, None]
        values = np.sqrt((errors**2).mean((1, 2)))
        axes.plot(flights.times, values, style, color=colour, linewidth=1.5, label=_label(name))
    for first, last in zimchuk.LEGS.values():
        if first:
            axes.axvline(flights.times[first], color="0.75", linewidth=0.8, zorder=0)
        if first in (200, 500):
            axes.axvspan(flights.times[first], flights.times[last - 1], color="0.95", zorder=-1)
    _error_axes(axes, f"Error over time, {result.runs} runs; manoeuvres shaded")
    axes.set(xlabel="time [s]", xlim=(0.0, flights.times[-1]))


def _draw_legs(axes: Any, result: Reproduction) -> None:
    """RMSE on each leg, beside the published values."""
    cells: dict[str, list[Cell]] = {}
    for cell in result.cells:
        cells.setdefault(cell.row, []).append(cell)
    places = np.arange(len(zimchuk.LEGS))
    shifts = np.linspace(-0.3, 0.3, len(STYLES))
    for shift, (name, (colour, _, marker)) in zip(shifts, STYLES.items(), strict=True):
        ours = [cell.ours for cell in cells[name]]
        axes.plot(places + shift, ours, marker, color=colour, markersize=6, label=_label(name))
        published = [cell.published for cell in cells[name]]
        if not np.isnan(published).any():
            axes.plot(places + shift, published, marker, color=colour, markersize=9, markerfacecolor="none")
    _error_axes(axes, "RMSE on each leg; open: in the paper")
    axes.set_xticks(places, list(zimchuk.LEGS))
    axes.legend(fontsize=8, ncols=2)
