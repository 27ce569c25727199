"""Parsing of schemes, layouts, and options that do not fit together; values are in
`test_options_values`.
"""

import gymnasium as gym
import numpy as np
import pytest

import hybrid_env
from hybrid_env import (
    FixedScheme,
    HybridTrackEnv,
    Layout,
    QuickestLayout,
    RandomScheme,
    Segment,
    WorldOptions,
    parse_scheme,
)
from hybrid_env.checks import ArgumentError
from hybrid_env.scheme import SCHEMES, segment_table

SCHEME_TEXTS = {
    "L50r3 R75r5.5 S50": FixedScheme(
        (Segment("L", 50, 3.0), Segment("R", 75, 5.5), Segment("S", 50))
    ),
    "S1, L2r.5": FixedScheme((Segment("S", 1), Segment("L", 2, 0.5))),
    "L5r2e3 S5": FixedScheme((Segment("L", 5, 2000.0), Segment("S", 5))),
    "L5r1e12 L5r1e-12 R5r0.30000000000000004": FixedScheme(
        (Segment("L", 5, 1e12), Segment("L", 5, 1e-12), Segment("R", 5, 0.1 + 0.2))
    ),
    "random": RandomScheme(),
    "random 4x20-60": RandomScheme(4, (20, 60)),
    "random 2x30": RandomScheme(2, (30, 30)),
}


@pytest.mark.parametrize("text", SCHEME_TEXTS)
def test_a_text_stands_for_a_scheme_which_has_a_text_again(text):
    scheme = SCHEME_TEXTS[text]
    assert parse_scheme(text) == scheme
    assert parse_scheme(str(scheme)) == scheme


@pytest.mark.parametrize(
    ("name", "pieces", "ticks"),
    [
        ("golubkov2018", 6, 360),
        ("tsyganov2019", 9, 2506),
        ("golubkov2020", 2, 40),
    ],
)
def test_schemes_of_the_papers_have_their_published_lengths(name, pieces, ticks):
    scheme = parse_scheme(name)
    assert len(scheme.pieces) == pieces
    assert sum(piece.length for piece in scheme.pieces) == ticks
    assert set(SCHEMES) == {"golubkov2018", "tsyganov2019", "golubkov2020"}


def test_modes_are_straight_left_right_and_unknown_radii_map_to_the_nearest_curvature():
    table = segment_table(parse_scheme("S10 L10r3 R10r3 L10r2.9 R10r100"), [1.0, 3.0, 10.0])
    assert table[:, 1].tolist() == [0, 2, 5, 2, 6]
    assert segment_table(RandomScheme(), [1.0, 3.0])[:, 1].tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("mode", ["ascii", 3])
def test_an_unknown_render_mode_is_refused(mode):
    with pytest.raises(ArgumentError, match=r"^render_mode=.* expected"):
        HybridTrackEnv(render_mode=mode)


def test_exact_correctness_requires_the_radii_of_the_scheme_in_the_bank():
    with pytest.raises(ArgumentError, match=r"radii=\(5.0,\).*3.0"):
        WorldOptions(scheme="L50r3")
    assert WorldOptions(scheme="L50r3", correctness="type").hypotheses == 3


@pytest.mark.parametrize(
    "hypotheses",
    [0, 1, 2, 4, -3, 3.0, "3", True, np.array(3)],
    ids=repr,
)
def test_a_layout_requires_an_odd_number_of_hypotheses(hypotheses):
    with pytest.raises(ArgumentError, match="hypotheses="):
        Layout(hypotheses)


def test_a_layout_is_determined_by_its_width_and_invalid_widths_raise():
    assert Layout.of_width(136).hypotheses == 21
    for width in (0, 10, 16, 29):
        with pytest.raises(ArgumentError, match="width="):
            Layout.of_width(width)
    with pytest.raises(ArgumentError, match="log_odds"):
        Layout(3).read(np.zeros(28), "log_odds")
    for width in (0, 27, 29, 40):
        with pytest.raises(ArgumentError, match="observation shape"):
            Layout(3).read(
                np.zeros((5, width), np.float32),
                "log_ratio",
            )


@pytest.mark.parametrize("kind", [Layout, QuickestLayout])
@pytest.mark.parametrize("hypotheses", [3, 21])
def test_a_layout_shows_where_its_quantities_are(kind, hypotheses):
    layout = kind(hypotheses)
    title, _, listed = repr(layout).partition(": ")

    assert title == f"{kind.__name__}({hypotheses})"
    places = dict(entry.split(" ") for entry in listed.split(", "))
    assert places == {name: f"{place.start}:{place.stop}" for name, place in layout.slices.items()}


def test_repeated_registration_of_the_ids_does_not_raise():
    import importlib

    importlib.reload(hybrid_env)

    assert {"HybridTrackPublished-v0", "HybridTrackPublishedBank-v0"} <= set(gym.registry)
