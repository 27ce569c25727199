"""Figures of Tsyganov 2019: one run of ATE for each measurement variance."""

from matplotlib.figure import Figure

from studies.papers.figures.golubkov2018 import tracking_figures
from studies.papers.reproduction import Reproduction
from studies.papers.tsyganov2019 import ALPHA, MEASUREMENT_VARIANCES, RADIUS


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figures by their file names."""
    return tracking_figures("tsyganov2019", result, MEASUREMENT_VARIANCES, (RADIUS,), ALPHA)
