"""The figure of the operating curves, drawn from curves with given means."""

import numpy as np
import pytest
from agents.comparison.figures import operating_curves
from agents.comparison.plan import Plan
from agents.comparison.report import summary_lines, unreached_accuracy_lines
from agents.comparison.study import ACCURACY_LEVELS, Comparison, Entry
from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.evaluate import Decisions
from agents.evaluation.operating_curve import (
    ACCURACY,
    REWARD,
    TICKS,
    Estimate,
    OperatingCurve,
    at_threshold,
    error_at_ticks,
    ticks_at_accuracy,
)

from agents.figures.decider_colours import STYLES
from baselines import FixedTimeDecider
from baselines.rules.posterior_paths import PosteriorPaths
from hybrid_env import WorldOptions

SEGMENTS = 1000
REFERENCE = ("ATE (SPRT)", [0.7, 0.9, 0.96, 0.985], [15, 20, 26, 32])
FAST = ("ppo", [0.6, 0.95, 0.99, 1.0], [5, 12, 16, 30])
LATE = ("fixed time", [0.5, 0.8, 0.97, 0.999, 1.0], [5, 15, 30, 50, 90])
INACCURATE = ("MSPRT", [0.4, 0.8, 0.92], [4, 12, 18])


def entry(name, accuracy, ticks, chosen=1, episodes=4):
    decisions = []
    shape = (episodes, SEGMENTS)
    for share, time in zip(accuracy, ticks, strict=True):
        correct = np.zeros(shape, bool)
        correct[:, : round(SEGMENTS * share)] = True
        flags, zeros, ones = np.zeros(shape, bool), np.zeros(shape, int), np.ones(shape, int)
        decisions.append(
            Decisions(correct, correct, time * ones, flags, zeros, zeros, ones, 1.0 * zeros, 0.02)
        )
    thresholds = tuple(float(index) for index in range(len(ticks)))
    family = DeciderFamily(name, "alpha", thresholds, 0.0, lambda _: FixedTimeDecider(1))
    curve = OperatingCurve(family, tuple(decisions))
    return Entry(
        curve,
        chosen,
        curve.estimate(at_threshold(ACCURACY, chosen)),
        curve.estimate(at_threshold(TICKS, chosen)),
        curve.estimate(at_threshold(REWARD, chosen)),
        Estimate(0.0, 0.0, 0.0),
        curve.estimate(error_at_ticks(20.0)),
        {level: curve.estimate(ticks_at_accuracy(level)) for level in ACCURACY_LEVELS},
        (0.1, 0.2),
    )


def comparison(*entries, accuracy=None, curves=True):
    names = tuple(one.name for one in entries)
    plan = Plan("hybrid_env:HybridTrack-v0", {}, names[:1], names[1:], 4, 0, None, 1, accuracy, curves)
    paths = PosteriorPaths(np.zeros((1, 1)), np.zeros((1, 1), bool), np.ones(1, int), "hypothesis")
    return Comparison(plan, WorldOptions(), 20.0, entries, paths)


@pytest.fixture(scope="module")
def figure():
    return operating_curves(comparison(entry(*REFERENCE), entry(*FAST), entry(*LATE)))


def labels_of(axes):
    """Texts beside the curves; those of arrows are empty."""
    return [text.get_text() for text in axes.texts if text.get_text()]


def test_both_panels_show_every_decider(figure):
    assert figure.axes[0].get_xlim()[1] < 90
    for axes in figure.axes:
        assert set(labels_of(axes)) == {"ATE (SPRT)", "ppo", "fixed time"}


def test_accuracy_levels_that_are_not_reached_are_marked_at_the_edge(figure):
    left, _ = operating_curves(comparison(entry(*REFERENCE), entry(*INACCURATE))).axes
    notes = [text for text in labels_of(left) if "not reached" in text]
    assert notes == ["95 % not reached", "98 % not reached"]
    marks = [
        line for line in left.lines if len(line.get_xdata()) == 1 and line.get_markerfacecolor() == "white"
    ]
    assert [line.get_color() for line in marks] == 2 * [STYLES["MSPRT"].colour]
    assert not any("not reached" in name for name in labels_of(figure.axes[0]))


def test_a_single_threshold_says_nothing_about_accuracy_levels():
    single = entry("MSPRT", [0.92], [18], chosen=0)
    left, _ = operating_curves(comparison(entry(*REFERENCE), single, curves=False)).axes
    assert not any("not reached" in name for name in labels_of(left))


@pytest.mark.parametrize("chosen", [0, 4])
def test_the_selected_threshold_is_inside_the_axes(chosen):
    figure = operating_curves(comparison(entry(*REFERENCE), entry(*LATE, chosen=chosen)))
    for axes in figure.axes:
        box = axes.get_window_extent()
        filled = [line for line in axes.lines if line.get_markersize() == 8]
        assert len(filled) == 2
        for line in filled:
            assert all(box.contains(*point) for point in axes.transData.transform(line.get_xydata()))


def test_training_seeds_are_one_curve():
    seeds = [entry(f"ppo seed {seed}", FAST[1], [tick + seed for tick in FAST[2]]) for seed in range(3)]
    result = comparison(entry(*REFERENCE), *seeds)
    assert {name: len(group) for name, group in result.seed_groups().items()} == {"ATE (SPRT)": 1, "ppo": 3}
    for axes in operating_curves(result).axes:
        assert "ppo, 3 seeds" in labels_of(axes)
    assert any(line.startswith("ppo over 3 training seeds") for line in summary_lines(result))


def test_unreached_accuracy_is_reported():
    result = comparison(entry(*REFERENCE), entry(*INACCURATE), accuracy=0.95)
    assert unreached_accuracy_lines(result) == [
        "MSPRT does not reach 95.0%: its most accurate threshold is shown"
    ]


def test_largest_difference_names_the_best_agent():
    best, episode = comparison(entry(*REFERENCE), entry(*LATE), entry(*FAST)).largest_difference()
    assert best.name == "ppo"
    assert episode == 0
    assert comparison(entry(*REFERENCE)).largest_difference() is None
