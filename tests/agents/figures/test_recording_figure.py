"""The figure of a recorded track: lines and bars in the colours of the modes, gaps left out."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from agents.figures.tracks import recording_figure

NAMES = ("straight", "left turn", "right turn")
# A gap of five minutes between them.
PIECES = [(0, 6), (6, 10)]
MINUTES = np.array([0.0, 1, 2, 3, 4, 5, 10, 11, 12, 13])
POINTS = np.stack([MINUTES, 0.5 * MINUTES], axis=1)
# 3 is not scored.
LABELS = np.array([0, 0, 0, 1, 1, 3, 2, 2, 2, 2])
STATED = {"beam": np.array([0, 0, 0, 0, 1, 1, 0, 2, 2, 2]), "CUSUM": np.zeros(10, int)}


@pytest.fixture(scope="module")
def figure():
    figure = recording_figure(POINTS, MINUTES, PIECES, LABELS, STATED, NAMES, "a flight")
    figure.draw_without_rendering()
    return figure


@pytest.fixture(scope="module")
def colours(figure):
    """Colours of the modes by the legend."""
    lines = {line.get_label(): to_hex(line.get_color()) for line in figure.legends[0].get_lines()}
    return [lines[name] for name in (*NAMES, "not scored")]


def test_bars_show_labels_and_statements_but_no_gap(figure, colours):
    timeline = figure.axes[1]
    assert [label.get_text() for label in timeline.get_yticklabels()] == ["label", "beam", "CUSUM"]
    bars = [
        (
            round(bar.get_y() + bar.get_height() / 2),
            bar.get_x(),
            bar.get_width(),
            to_hex(bar.get_facecolor()),
        )
        for bar in timeline.patches
    ]
    straight, left, right, _ = colours
    assert bars == [
        (0, 0, 3, straight),
        (0, 3, 2, left),
        (0, 10, 3, right),
        (1, 0, 4, straight),
        (1, 4, 1, left),
        (1, 10, 1, straight),
        (1, 11, 2, right),
        (2, 0, 5, straight),
        (2, 10, 3, straight),
    ]
    assert timeline.get_xlabel() == "t [min]"
    assert timeline.get_xlim() == (0.0, 13.0)
