"""Labels beside curves: no overlap with curves, with markers or with each other."""

import itertools

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from agents.figures.curve_labels import label_curves


def new_axes():
    figure = Figure(figsize=(6, 4), layout="constrained", dpi=100)
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.set_xlim(0, 10)
    axes.set_ylim(0, 10)
    return axes


def points_of(line):
    """Pixels along a line, one or more per pixel."""
    points = line.get_transform().transform(line.get_xydata())
    steps = [np.linspace(start, end, 2000) for start, end in itertools.pairwise(points)]
    return np.concatenate([points, *steps])


def assert_no_overlap(axes, curves, annotations):
    boxes = [annotation.get_window_extent() for annotation in annotations]
    for one, other in itertools.combinations(boxes, 2):
        assert not one.overlaps(other)
    area = axes.get_window_extent()
    for box in boxes:
        assert area.x0 <= box.x0
        assert box.x1 <= area.x1
        assert area.y0 <= box.y0
        assert box.y1 <= area.y1
        for line, _ in curves:
            points = points_of(line)
            inside = (points > box.min).all(1) & (points < box.max).all(1)
            assert not inside.any()


def distance(box, line):
    points = points_of(line)
    return np.hypot(*(points - np.clip(points, box.min, box.max)).T).min()


def test_labels_stand_beside_their_own_curves():
    axes, x = new_axes(), np.linspace(0, 10, 30)
    lines = [axes.plot(x, level + 0.1 * x, marker="o")[0] for level in (1, 4, 7)]
    curves = [(line, f"curve {number}") for number, line in enumerate(lines)]
    annotations = label_curves(axes, curves)
    assert [annotation.get_text() for annotation in annotations] == ["curve 0", "curve 1", "curve 2"]
    assert_no_overlap(axes, curves, annotations)
    for annotation, line in zip(annotations, lines, strict=True):
        box = annotation.get_window_extent()
        assert min(lines, key=lambda other: distance(box, other)) is line
        assert distance(box, line) < 15


def test_labels_of_coinciding_curves_are_spread():
    axes, x = new_axes(), np.linspace(0, 10, 30)
    curves = [(axes.plot(x, 5 + 0.02 * k * x)[0], f"coinciding curve {k}") for k in range(7)]
    annotations = label_curves(axes, curves)
    assert_no_overlap(axes, curves, annotations)


def test_a_distant_label_has_a_leader_line_to_its_curve():
    axes = new_axes()
    line = axes.plot([5], [5], "o", markersize=5)[0]
    obstacles = [axes.plot([0, 10], [y, y], color="0.8")[0] for y in np.arange(4.0, 6.1, 0.2)]
    before = len(axes.lines)
    (annotation,) = label_curves(axes, [(line, "hidden point")])
    assert_no_overlap(axes, [(one, "") for one in obstacles], [annotation])
    assert len(axes.lines) == before + 1
    leader = axes.lines[-1]
    assert leader.get_color() == line.get_color()
    ends = leader.get_transform().transform(leader.get_xydata())
    point = axes.transData.transform((5, 5))
    assert np.hypot(*(ends[0] - point)) < 8
    assert distance(annotation.get_window_extent(), leader) < 5


def test_the_label_of_a_curve_outside_the_axes_is_at_the_edge():
    axes = new_axes()
    line = axes.plot([12, 14], [5, 5])[0]
    (annotation,) = label_curves(axes, [(line, "outside")])
    box, area = annotation.get_window_extent(), axes.get_window_extent()
    assert area.x1 - 20 < box.x1 <= area.x1
    assert abs((box.y0 + box.y1) / 2 - axes.transData.transform((0, 5))[1]) < 25


@pytest.mark.parametrize("seed", range(3))
def test_many_random_curves_are_labelled_without_overlap(seed):
    generator, axes, x = np.random.default_rng(seed), new_axes(), np.linspace(0, 10, 12)
    curves = []
    for k in range(9):
        y = 1 + generator.uniform(2, 8) * (1 - np.exp(-x / generator.uniform(1, 4)))
        curves.append((axes.plot(x, y, marker="o", markersize=4)[0], f"decider {k}"))
    assert_no_overlap(axes, curves, label_curves(axes, curves))


def test_a_name_with_dollar_signs_is_no_formula():
    axes = new_axes()
    (line,) = axes.plot([0, 5, 10], [1, 5, 9])
    (annotation,) = label_curves(axes, [(line, r"run $\frac{$")])
    assert annotation.get_text() == r"run $\frac{$"
    assert annotation.get_window_extent().width > 0
