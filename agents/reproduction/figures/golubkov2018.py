"""Figures of Golubkov 2018: one run of ATE for each measurement variance."""

from matplotlib.figure import Figure

from agents.reproduction.tracking_figure import tracking_figures
from baselines.papers.golubkov2018 import ALPHA, MEASUREMENT_VARIANCES, RADII
from baselines.papers.reproduction import Reproduction


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figures by their file names."""
    return tracking_figures("golubkov2018", result, MEASUREMENT_VARIANCES, RADII, ALPHA)
