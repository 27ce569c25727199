"""Figures of Tsyganov 2019: one run of ATE for each measurement variance."""

from matplotlib.figure import Figure

from agents.reproduction.figures.golubkov2018 import tracking_figures
from baselines.papers.reproduction import Reproduction
from baselines.papers.tsyganov2019 import ALPHA, MEASUREMENT_VARIANCES, RADIUS


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figures by their file names."""
    return tracking_figures("tsyganov2019", result, MEASUREMENT_VARIANCES, (RADIUS,), ALPHA)
