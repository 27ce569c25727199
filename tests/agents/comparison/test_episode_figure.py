"""The figure of one episode with two deciders."""

import numpy as np
import pytest

from agents.comparison.episode_figure import draw_episode, episode_figure, record_episode
from agents.interface.decider_colours import STYLES
from baselines import FixedTimeDecider, SPRTDecider
from hybrid_env import WorldOptions

ENV = "hybrid_env:HybridTrack-v0"
OPTIONS = {"scheme": "L40r5 S30 R60r5 S40"}


@pytest.fixture(scope="module")
def records():
    return (
        record_episode("ATE (SPRT)", SPRTDecider(1e-3), ENV, 3, **OPTIONS),
        record_episode("ppo", FixedTimeDecider(2), ENV, 3, **OPTIONS),
    )


def test_decisions_are_marked_on_the_track_filled_when_correct(records):
    figure = episode_figure(*records, WorldOptions(**OPTIONS), "title")
    track = figure.axes[0]
    for record in records:
        style = STYLES[record.name]
        marks = [line for line in track.lines if line.get_marker() == style.marker]
        assert all(line.get_color() == style.colour for line in marks)
        filled = {line.get_markerfacecolor() == style.colour: len(line.get_xdata()) for line in marks}
        assert filled == {True: record.correct.sum(), False: (~record.correct).sum()}
        for line in marks:
            for x, y in line.get_xydata():
                distance = np.hypot(record.column("x") - x, record.column("y") - y)
                assert distance.min() == 0.0


def test_legends_are_outside_the_axes(records):
    figure = episode_figure(*records, WorldOptions(**OPTIONS), "title")
    figure.draw_without_rendering()
    for axes in figure.axes:
        assert axes.get_legend().get_window_extent().x0 >= axes.get_window_extent().x1 - 1


def test_timeline_shows_decision_times_and_mode_names(records, tmp_path):
    figure = episode_figure(*records, WorldOptions(**OPTIONS), "title")
    timeline = figure.axes[1]
    assert [label.get_text() for label in timeline.get_yticklabels()] == ["true mode", "ATE (SPRT)", "ppo"]
    texts = [text.get_text() for text in timeline.texts]
    begins = np.concatenate([[0], records[0].ends[:-1]])
    for record in records:
        for ticks in record.decided - begins:
            assert str(ticks) in texts
    draw_episode(*records, WorldOptions(**OPTIONS), "title", tmp_path / "episode.png")
    assert (tmp_path / "episode.png").read_bytes().startswith(b"\x89PNG")
