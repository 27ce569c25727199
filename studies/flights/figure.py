"""The picture of a recorded flight: its ground track and timelines by the modes."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from studies.flights.flight import Flight
from studies.flights.labels import MODE_NAMES
from studies.flights.turns import IntArray


def flight_figure(
    flight: Flight,
    labels: IntArray,
    stated: Mapping[str, IntArray],
    title: str,
    label: str = "label",
) -> Figure:
    """Draw the ground track by the modes of the first decider over the labels, and all modes over
    time.

    Args:
        flight: of n positions.
        labels: (n,) modes, or 3 where they are not scored.
        stated: statements (n,) by the name of the decider.
        title: of the picture.
        label: what the labels are called.
    """
    names = [label, *stated]
    modes = np.array([labels, *stated.values()])
    # Red, blue and green in the palette of Okabe and Ito, and grey.
    colours = ListedColormap(["#d55e00", "#0072b2", "#009e73", "#c8c8c8"])
    style = {"cmap": colours, "vmin": -0.5, "vmax": 3.5}
    figure, (ground, timeline) = plt.subplots(
        2,
        1,
        figsize=(10.0, 8.0 + 0.3 * len(names)),
        height_ratios=(6.0, 0.3 * (1 + len(names))),
        layout="constrained",
    )
    for rows in flight.pieces:
        x, y = flight.positions[rows].T / 1000.0
        ground.scatter(x, y, 40.0, modes[0, rows], alpha=0.3, linewidths=0.0, **style)
        ground.scatter(x, y, 3.0, modes[1, rows], **style)
        minutes = flight.times[rows] / 60.0
        mesh = timeline.pcolormesh(minutes, names, modes[:, rows], shading="nearest", **style)
    ground.set_aspect("equal", adjustable="datalim")
    ground.set(xlabel="x east [km]", ylabel="y north [km]", title=f"narrow: {names[1]}")
    timeline.set(xlabel="t [min]")
    timeline.invert_yaxis()
    bar = figure.colorbar(mesh, ax=ground)
    bar.set_ticks(range(4), labels=[*MODE_NAMES, "not scored"])
    figure.suptitle(title)
    return figure
