"""Figure of the filters of Zimchuk & Kankin: position error over time, and RMSE on each leg."""

import numpy as np
from matplotlib.figure import Figure

from agents.figures.canvas import GREY
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import DeciderStyle
from studies.papers import zimchuk
from studies.papers.reproduction import Reproduction

STYLES = {
    "adaptive, as published": DeciderStyle("#AA3377", "o"),
    "adaptive, corrected": DeciderStyle("#CCBB44", "s"),
    "Kalman, sigma_w = 4.64": DeciderStyle("#000000", "v"),
    "Kalman, sigma_w = 20": DeciderStyle("#4477AA", "D"),
    "Kalman, sigma_w = 60": DeciderStyle("#4D4D4D", "^"),
    "measurements": DeciderStyle(GREY, "x"),
}


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figure by its file name."""
    flights = result.examples["flights"]
    legs = np.arange(len(zimchuk.LEGS))
    times = flights.times
    errors = []
    points = []
    for shift, (name, style) in zip(
        np.linspace(-0.3, 0.3, len(STYLES)),
        STYLES.items(),
        strict=True,
    ):
        label = name.replace("sigma_w = ", "") + (" m/s²" if "sigma_w" in name else "")
        rmse = np.sqrt(((result.examples[name] - flights.truth[:, None, None]) ** 2).mean((1, 2)))
        errors.append(Curve(label, style, times, rmse, size=0.0))
        cells = [cell for cell in result.cells if cell.row == name]
        for values, filled in (
            ([cell.ours for cell in cells], True),
            ([cell.published for cell in cells], False),
        ):
            points.append(
                Curve(label, style, legs + shift, values, size=7.0, filled=filled, dashes="none")
            )
    rmse_axis = Axis(
        "RMSE of the position on an axis [m]",
        (1.2, 50.0),
        {tick: f"{tick:g}" for tick in (1.5, 2, 3, 5, 10, 20, 40)},
        log=True,
    )
    begins = tuple(times[first] for first, _ in zimchuk.LEGS.values() if first)
    time_axis = Axis("time [s]", (0.0, times[-1]), levels=begins)
    leg_axis = Axis(ticks=dict(zip(legs.tolist(), zimchuk.LEGS, strict=True)))
    panels = [
        Panel(
            f"Error over time, {result.runs} runs; dashed: a leg begins",
            time_axis,
            rmse_axis,
            errors,
        ),
        Panel("RMSE on each leg; open: in the paper", leg_axis, rmse_axis, points),
    ]
    title = f"{result.paper}: uniform motion and two manoeuvres, R = {zimchuk.VARIANCE:g} m²"
    return {"zimchuk.png": curve_figure([panels], (15.0, 5.6), title)}
