"""Panels of curves: legend, colours and markers."""

import numpy as np
import pytest

from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import decider_style
from agents.interface.output_files import save_figure
from hybrid_env import ArgumentError

TICKS = np.array([5.0, 15.0, 30.0, 50.0, 90.0])
TIME = Axis("ticks", (0.0, 60.0))
REWARD = Axis("reward", (0.0, 1.0), levels=(0.5,))


def curve(name, values, **more):
    return Curve(name, decider_style(name), TICKS, np.array(values), **more)


CURVES = [
    curve(
        "ATE (SPRT)",
        [0.2, 0.6, 0.7, 0.75, 0.8],
        selected=[(15.0, 0.6)],
    ),
    curve(
        "ppo",
        [0.3, 0.7, 0.8, 0.85, 1.2],
        bounds=np.array([[0.2] * 5, [0.9] * 5]),
    ),
    curve(
        "fixed time",
        [0.1, 0.3, 0.4, 0.45, 0.5],
        size=0.0,
        dashes="--",
    ),
]


@pytest.fixture(scope="module")
def figure():
    panels = [Panel("left", TIME, REWARD, CURVES), Panel("right", TIME, REWARD, CURVES[:2])]
    return curve_figure([panels], (11.5, 5.2), "title", "note")


def test_one_legend_beside_the_panels_has_every_curve(figure, tmp_path):
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [one.name for one in CURVES]
    assert not any(axes.get_legend() for axes in figure.axes)
    save_figure(figure, tmp_path / "curves.png")
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    assert legend.get_window_extent().x0 > max(axes.get_window_extent().x1 for axes in figure.axes)


def test_curves_have_the_colours_and_markers_of_their_deciders_and_selected_points_are_filled(
    figure,
):
    axes = figure.axes[0]
    for one in CURVES:
        drawn = [line for line in axes.lines if line.get_color() == one.style.colour]
        assert {line.get_marker() for line in drawn} <= {one.style.marker, "None"}
        assert [line for line in drawn if line.get_linestyle() == one.dashes]
        filled = [line.get_xydata().tolist() for line in drawn if line.get_markersize() == 8]
        assert filled == [[list(point)] for point in one.selected]


def test_a_figure_that_cannot_be_written_is_an_error_that_names_its_file(figure, tmp_path):
    with pytest.raises(ArgumentError, match=r"missing.curves\.png"):
        save_figure(figure, tmp_path / "missing" / "curves.png")
