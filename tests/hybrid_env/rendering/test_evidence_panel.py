"""The evidence panel with the evidence of a decider."""

from itertools import combinations

import gymnasium as gym
import numpy as np
import pytest

import hybrid_env  # noqa: F401
from hybrid_env.rendering import FRAME_SIZE
from hybrid_env.rendering.evidence import TYPE_COLOURS, EvidencePanel, Threshold, sprt_panel
from hybrid_env.rendering.figure import EpisodeFigure

RADII = tuple(float(radius) for radius in range(1, 11))
POSTERIOR = EvidencePanel(
    label="posterior probability (neural network)",
    limits=(1e-7, 1.0 - 1e-7),
    scale="logit",
    thresholds=(Threshold(np.array([1.0 - 1e-6])),),
    legend="1 - alpha at alpha = 1e-06",
)


def started(scheme="S20 L20r5", **options):
    env = gym.make(
        "HybridTrackPublished-v0",
        render_mode="rgb_array",
        scheme=scheme,
        **options,
    ).unwrapped
    env.reset(seed=0)
    return env


def evidence_lines(env, panel):
    figure = EpisodeFigure(env.options, panel)
    figure.draw(env.history)
    lines = figure.figure.axes[1].lines
    return lines[: len(panel.thresholds)], lines[len(panel.thresholds) :]


def drawn_texts(figure):
    yield from figure.texts
    for legend in figure.legends:
        yield from legend.get_texts()
    for axes in figure.axes:
        yield from axes.texts
        for axis in (axes.xaxis, axes.yaxis):
            yield axis.label
            low, high = axis.get_view_interval()
            for place, label in zip(
                axis.get_majorticklocs(),
                axis.get_majorticklabels(),
                strict=True,
            ):
                if low <= place <= high:
                    yield label


@pytest.mark.parametrize("alpha", [0.1, 1e-3, 1e-10])
def test_the_thresholds_of_the_sprt_are_drawn_inside_the_panel(alpha):
    panel = sprt_panel(alpha)
    (upper, lower), _ = evidence_lines(started(), panel)

    np.testing.assert_allclose(
        upper.get_ydata(),
        np.log((1.0 - alpha) / alpha),
    )
    np.testing.assert_allclose(
        lower.get_ydata(),
        np.log(alpha / (1.0 - alpha)),
    )
    assert panel.limits[0] < lower.get_ydata()[0] < upper.get_ydata()[0] < panel.limits[1]
    assert f"alpha = {alpha:g}" in panel.legend


def test_the_evidence_of_the_current_tick_can_be_replaced():
    env = started()
    values = np.array([0.2, 0.7, 0.1])
    env.history.set_evidence(values)
    env.step(2)

    np.testing.assert_array_equal(env.history.evidence[0], values)
    assert np.isnan(env.history.evidence[1:-1]).all()
    assert env.history.decisions[0].evidence == 0.7
    _, curves = evidence_lines(env, POSTERIOR)
    assert [curve.get_color() for curve in curves] == list(TYPE_COLOURS)
    assert [np.asarray(curve.get_ydata())[1] for curve in curves] == values.tolist()


@pytest.mark.parametrize(
    "radii",
    [(5.0,), (3.0, 4.0, 5.0), RADII, tuple(np.linspace(1, 50, 50).tolist())],
)
@pytest.mark.parametrize("panel", [sprt_panel(1e-3), sprt_panel(1e-9), POSTERIOR])
def test_texts_are_inside_the_frame_and_do_not_overlap(radii, panel):
    env = started(scheme="L60r5 S60", radii=radii, correctness="type")
    env.step(2)
    figure = EpisodeFigure(env.options, panel)
    figure.draw(env.history)
    boxes = {text: text.get_window_extent() for text in drawn_texts(figure.figure)}

    assert len(boxes) > 25
    for text, box in boxes.items():
        assert (box.min >= 0).all(), text
        assert (box.max <= FRAME_SIZE).all(), text
    for (one, box), (other, other_box) in combinations(boxes.items(), 2):
        assert not box.overlaps(other_box), (one, other)
    panels = [
        axes.get_tightbbox(figure.figure.canvas.get_renderer()) for axes in figure.figure.axes
    ]
    for legend in figure.figure.legends:
        assert legend.get_window_extent().y1 <= min(panel.y0 for panel in panels)
