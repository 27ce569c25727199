"""Figures of the radar study: a flight with its measurements, errors of all filters, KF CV as
published.
"""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch

from studies.papers.figures import DARK_GREY, GREY, TRUTH, new_figure, style_map
from studies.papers.reproduction import Reproduction
from studies.radar.filters import THESIS
from studies.radar.radars import NOISES, RANGE, Noise
from studies.radar.reproduction import Example
from studies.radar.tables import NOISE_NAMES, TABLES, UNFILTERED, as_published

RADARS, SOUND = "#AA3377", "#88CCEE"
PUBLISHED_CV = as_published("KF CV")
COLOURS = {
    UNFILTERED: GREY,
    "g-h": "#CCBB44",
    "KF CV": "#4477AA",
    "KF CA": "#EE6677",
    "KF CJ": "#228833",
}
SHOWN: dict[Noise, dict[str, str]] = {
    "gaussian": {
        "g-h": "#CCBB44",
        "KF CA": "#EE6677",
        "CV": "#4477AA",
    },
    "levy": {
        "KF CA": "#EE6677",
        "CV": "#4477AA",
        "CV, Huber": "#228833",
    },
}
"""Estimates in the figure of the flight, with their colours."""

# Measurements in the enlarged part of the flight.
WINDOW = 16


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figures by their file names."""
    example: Example = result.examples["flight"]
    return {
        "novospaskyi_flight.png": _flight(result, example),
        "novospaskyi_errors.png": _errors(result, "RMSE"),
        "novospaskyi_mae.png": _errors(result, "MAE"),
        "novospaskyi_kf_cv.png": _anomaly(result, example),
    }


def _flight(result: Reproduction, example: Example) -> Figure:
    """The flight with its radars (as figures 2.1.3 and 2.1.4), and its strongest turn for each
    noise.
    """
    title = f"{result.paper}: one test flight, two radars with a range of {RANGE / 1000:g} km"
    figure, (axes, *turns) = new_figure(
        title,
        (16.0, 5.8),
        (1.0, 1.0, 1.0),
    )
    axes.plot(
        *example.flight.positions[:, :2].T / 1000.0,
        color=TRUTH,
        linewidth=1.5,
        label="flight",
    )
    measured = example.tracks["gaussian"].measurements[0, :, :2].T / 1000.0
    axes.plot(
        *measured,
        ".",
        color=GREY,
        markersize=4,
        label="measurements",
    )
    radars = example.scan.radars[:, :2] / 1000.0
    axes.plot(
        *radars.T,
        "^",
        color=RADARS,
        markersize=9,
        label="radars",
    )
    for radar in radars:
        axes.add_patch(Circle(radar, RANGE / 1000.0, color=RADARS, alpha=0.08, linewidth=0))
    style_map(axes, "Flight from above, Gaussian noise", "km")
    axes.legend()
    for part, noise in zip(turns, NOISES, strict=True):
        _draw_turn(part, example, noise, _strongest_turn(example))
    return figure


def _strongest_turn(example: Example) -> int:
    """First measurement of the window in which the velocity changes most."""
    velocity = example.scan.velocities
    changes = np.linalg.norm(velocity[WINDOW:] - velocity[:-WINDOW], axis=1)
    spans = example.scan.times[WINDOW:] - example.scan.times[:-WINDOW]
    return int(np.where(spans <= WINDOW, changes, -1.0).argmax()) if len(changes) else 0


def _draw_turn(
    axes: Any,
    example: Example,
    noise: Noise,
    first: int,
) -> None:
    window = slice(first, first + WINDOW)
    times = example.scan.times[window]
    states = example.flight.states_at(np.linspace(times[0], times[-1], 200))[0]
    axes.plot(
        *states[:, :2].T,
        color=TRUTH,
        linewidth=3.0,
        label="flight",
    )
    for name, colour in SHOWN[noise].items():
        positions = example.estimates[noise][name][0][window]
        axes.plot(
            *positions[:, :2].T,
            ".-",
            color=colour,
            linewidth=1.3,
            markersize=5,
            label=name,
        )
    measured = example.tracks[noise].measurements[0, window, :2]
    low = states[:, :2].min(0) - 70.0
    high = states[:, :2].max(0) + 70.0
    axes.plot(
        *measured.T,
        "x",
        color=DARK_GREY,
        markersize=5,
    )
    outside = int(((measured < low) | (measured > high)).any(1).sum())
    hidden = f", {outside} outside" if outside else ""
    axes.set(
        title=f"Strongest turn, {NOISE_NAMES[noise]}\n(crosses: measurements{hidden})",
        xlabel="x [m]",
        ylabel="y [m]",
        xlim=(low[0], high[0]),
        ylim=(low[1], high[1]),
    )
    axes.legend()


def _errors(result: Reproduction, statistic: str) -> Figure:
    """RMSE or MAE of every filter with both noises, as figures 3.3.1 to 3.3.6."""
    title = (
        f"{result.paper}: {statistic} on the test flights; thin lines: 95 % of studies of this size"
    )
    figure, axes = new_figure(
        title,
        (17.0, 6.4),
        (1.0, 1.0, 1.0, 1.0),
    )
    for index, noise in enumerate(NOISES):
        for place, metric in enumerate((f"position {statistic}, m", f"velocity {statistic}, m/s")):
            _draw_bars(
                axes[2 * index + place],
                result,
                noise,
                metric,
            )
    handles = [
        Patch(
            facecolor="white",
            edgecolor=DARK_GREY,
            hatch="////",
            label="published",
        )
    ]
    ours = {DARK_GREY: "ours, as in the thesis", SOUND: "ours, sound and robust"}
    handles += [Patch(facecolor=colour, label=text) for colour, text in ours.items()]
    axes[1].legend(
        handles=handles,
        loc="lower right",
        fontsize=8,
    )
    return figure


def _draw_bars(
    axes: Any,
    result: Reproduction,
    noise: Noise,
    metric: str,
) -> None:
    tables = (TABLES[noise], f"Sound settings, {NOISE_NAMES[noise]}")
    velocity = metric.startswith("velocity")
    thesis, sound = (
        [cell for cell in result.tables[table] if cell.column == metric] for table in tables
    )
    sound = [cell for cell in sound if not (velocity and cell.row == UNFILTERED)]
    cells = [*thesis, *sound]
    rows = np.arange(len(thesis) + len(sound), dtype=np.float64)
    ours, low, high = np.array([(cell.ours, cell.low, cell.high) for cell in cells]).T
    colours = [COLOURS[name] for name in (UNFILTERED, *THESIS)] + [SOUND] * len(sound)
    bars = np.maximum([ours - low, high - ours], 0.0)
    rows[: len(thesis)] += 0.2
    axes.barh(
        rows,
        ours,
        0.36,
        color=colours,
        xerr=bars,
        error_kw={"elinewidth": 1.0},
    )
    axes.barh(
        rows[: len(thesis)] - 0.4,
        [cell.published for cell in thesis],
        0.36,
        facecolor="white",
        edgecolor=DARK_GREY,
        hatch="////",
        linewidth=0.6,
    )
    axes.axhline(
        len(thesis) - 0.5,
        color="0.6",
        linewidth=0.8,
    )
    axes.set_yticks(range(len(cells)), [cell.row for cell in cells])
    axes.invert_yaxis()
    axes.set(xlabel=metric.replace(", ", " [") + "]", title=NOISE_NAMES[noise])
    if velocity:
        ticks = [5, 10, 20, 40, 100, 400]
        axes.set(xscale="log", xlim=(3.0, 600.0))
        axes.set_xticks(ticks, [str(tick) for tick in ticks])
        axes.minorticks_off()


def _anomaly(result: Reproduction, example: Example) -> Figure:
    """Velocity and position errors of KF CV with the published and with the tuned parameters."""
    title = f"{result.paper}: KF CV with the published R (about 1e-9 m²) and with the true one"
    figure, panels = new_figure(f"{title}, Gaussian noise", (15.0, 5.0), (1.0, 1.0))
    tracks = example.tracks["gaussian"]
    truths = tracks.positions[0], tracks.velocities[0]
    estimates = example.estimates["gaussian"]
    for index, (axes, truth) in enumerate(zip(panels, truths, strict=True)):
        for name, label, colour in (
            ("KF CV", "KF CV, true R", COLOURS["KF CV"]),
            (PUBLISHED_CV, PUBLISHED_CV, RADARS),
        ):
            errors = (estimates[name][index] - truth)[:, 0]
            axes.plot(
                example.scan.times,
                errors,
                ".-",
                color=colour,
                label=label,
            )
        axes.set_xlabel("time [s]")
    panels[0].set(
        title="The position follows each measurement",
        ylabel="error of the position on x [m]",
    )
    panels[1].set(
        title="The velocity error changes sign at each one",
        ylabel="error of the velocity on x [m/s]",
    )
    panels[1].legend()
    return figure
