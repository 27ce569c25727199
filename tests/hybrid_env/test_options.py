"""Options: plain values checked by their declared types, and what does not fit together."""

import copy
import fractions
import math
import pickle

import numpy as np
import pytest
from declared import limits_of, refuse_beyond
from hostile_input import refused
from random_worlds import unit_scales

from hybrid_env import (
    FixedScheme,
    HybridTrackVectorEnv,
    Layout,
    QuickestLayout,
    QuickestOptions,
    Radar,
    RandomScheme,
    Segment,
    Sensor,
    WorldOptions,
    parse_scheme,
)
from hybrid_env.durations import GeometricDurations, UniformDurations
from hybrid_env.noises import GaussianNoise, LevyNoise, Noise, OutlierNoise, StudentNoise
from hybrid_env.scheme import SCHEMES, segment_table

DECLARED = {
    WorldOptions: {},
    QuickestOptions: {},
    Segment: {"mode": "L", "length": 5, "radius": 5.0},
    RandomScheme: {},
    OutlierNoise: {"share": 0.1},
    LevyNoise: {"index": 1.5},
    StudentNoise: {"freedom": 3.0},
    GeometricDurations: {"mean": 5.0},
    UniformDurations: {"shortest": 5, "longest": 9},
    Sensor: {"variance": 1.0},
    Radar: {"range_deviation": 1.0, "bearing_deviation": 0.1},
}
"""Dataclasses with declared fields, and their fields without a default."""


@pytest.mark.parametrize("kind", DECLARED)
def test_values_beyond_the_declared_ones_are_refused_in_one_line_that_names_the_field(kind):
    assert refuse_beyond(kind, **DECLARED[kind]) > 5


def test_values_at_the_limits_are_accepted():
    # No ratio is too large.
    others = {"radii": 100.0, "speed": 1e-6, "tau": 1e-6}
    for name in ("speed", "tau", "process_variance", "delay_cost", "evidence"):
        for value in limits_of(WorldOptions, name):
            assert getattr(WorldOptions(**others | {name: value}), name) == value


def plain(value):
    """Return True if a value consists of plain Python values."""
    if isinstance(value, tuple):
        return all(map(plain, value))
    if isinstance(value, (FixedScheme, RandomScheme, Segment)):
        return plain(tuple(vars(value).values()))
    return type(value) in (float, int, str, bool, type(None), GaussianNoise)


ACCEPTED = [
    {"measurement_variance": np.array([0.1, 0.2]), "radii": np.array([3, 5])},
    {
        "measurement_variance": np.float32(0.5),
        "radii": [3, np.int8(5)],
        "speed": np.int64(3),
        "initial_error": [0, np.float32(0.5)],
        "reset_covariance": np.bool_(True),
        "bank": np.str_("published"),
        "heading": fractions.Fraction(1, 3),
    },
    {"measurement_variance": np.array(0.1), "radii": 5, "initial_error": 0},
    {
        "scheme": FixedScheme(
            [Segment("S", np.int8(5)), Segment("L", np.uint64(9), np.float32(5.0))]
        )
    },
    {"scheme": RandomScheme(np.int16(3), np.array([5, 9]), np.array([5.0]))},
]


@pytest.mark.parametrize("given", ACCEPTED)
def test_values_are_stored_as_plain_python_values(given):
    options = WorldOptions(**given)
    assert plain(tuple(vars(options).values()))
    assert pickle.loads(pickle.dumps(options)) == options
    assert hash(options) == hash(copy.deepcopy(options))


REFUSED = [
    # By what an element of a list or a text says.
    {"radii": (5.0, math.nan)},
    {"radii": (5.0, 5.0)},
    {"radii": range(1, 1002)},
    {"measurement_variance": (0.1, 0.0)},
    {"initial_error": 0.5},
    {"noise": "outliers 1"},
    {"noise": GaussianNoise},
    {
        "noise": type(
            "OwnNoise", (Noise,), {"example": "own", "law": 2, "numbers": (1.5, 1.0, 4.0)}
        )()
    },
    {"likelihood": "levy 1.5"},
    {"sensors": ["radar 5"]},
    {"scheme": "L50r0"},
    {"scheme": "S50r3"},
    {"scheme": "S" + "9" * 4400},
    # By their ratios.
    {"radii": 1.0, "speed": 100.1, "tau": 1.0},
    {"measurement_variance": 1e-3, "process_variance": 1e18, "tau": 1.0},
    {"radii": 1e-12},
    # By another option.
    {"reset_covariance": True, "bank": "oracle"},
    {"recalculation": True, "follow": "bank"},
    {"refine_radius": True},
    {"likelihood": "student_t 4", "bank": "anchor_aware"},
    {"radii": (5.0,), "scheme": "L50r3"},
]


@pytest.mark.parametrize("given", REFUSED, ids=range(len(REFUSED)))
def test_values_that_do_not_fit_are_refused_by_name(given):
    assert refused(WorldOptions, **given).partition("=")[0] == next(iter(given))


def test_a_law_whose_numbers_were_replaced_after_their_check_is_checked_again():
    law = StudentNoise(3.0)
    object.__setattr__(law, "freedom", math.nan)
    refused(WorldOptions, noise=law)
    assert WorldOptions(noise=LevyNoise(1.5, 1.0, 44.0)) == WorldOptions(noise="levy 1.5 1 44")


SCHEME_TEXTS = {
    "L50r3 R75r5.5 S50": FixedScheme(
        (Segment("L", 50, 3.0), Segment("R", 75, 5.5), Segment("S", 50))
    ),
    "S1, L2r.5": FixedScheme((Segment("S", 1), Segment("L", 2, 0.5))),
    "L5r1e12 L5r1e-12 R5r0.30000000000000004": FixedScheme(
        (Segment("L", 5, 1e12), Segment("L", 5, 1e-12), Segment("R", 5, 0.1 + 0.2))
    ),
    "random": RandomScheme(),
    "random 2x30": RandomScheme(2, (30, 30)),
}


@pytest.mark.parametrize("text", SCHEME_TEXTS)
def test_a_text_stands_for_a_scheme_which_has_a_text_again(text):
    scheme = SCHEME_TEXTS[text]
    assert parse_scheme(text) == scheme
    assert parse_scheme(str(scheme)) == scheme


def test_schemes_of_the_papers_have_their_published_lengths():
    lengths = {name: [piece.length for piece in parse_scheme(name).pieces] for name in SCHEMES}
    assert {name: (len(ticks), sum(ticks)) for name, ticks in lengths.items()} == {
        "golubkov2018": (6, 360),
        "tsyganov2019": (9, 2506),
        "golubkov2020": (2, 40),
    }


def test_modes_are_straight_left_right_and_unknown_radii_map_to_the_nearest_curvature():
    table = segment_table(parse_scheme("S10 L10r3 R10r3 L10r2.9 R10r100"), [1.0, 3.0, 10.0])
    assert table[:, 1].tolist() == [0, 2, 5, 2, 6]
    assert segment_table(RandomScheme(), [1.0, 3.0])[:, 1].tolist() == [0, 1, 2, 3, 4]


def test_a_layout_is_of_an_odd_number_of_hypotheses_and_knows_its_width():
    assert refused(Layout, 4).startswith("hypotheses=4")
    assert Layout.of_width(136).hypotheses == 21
    assert refused(Layout.of_width, 29).startswith("width=29")
    assert "log_odds" in refused(Layout(3).read, np.zeros(28), "log_odds")
    assert "observation shape" in refused(Layout(3).read, np.zeros((5, 29)), "log_ratio")


@pytest.mark.parametrize("kind", [Layout, QuickestLayout])
def test_a_layout_shows_where_its_quantities_are(kind):
    layout = kind(21)
    title, _, listed = repr(layout).partition(": ")

    assert title == f"{kind.__name__}(21)"
    places = dict(entry.split(" ") for entry in listed.split(", "))
    assert places == {name: f"{place.start}:{place.stop}" for name, place in layout.slices.items()}


SENSED = {
    "missed": 0.2,
    "noise": "student_t 3",
    "sensors": [
        {"variance": 0.2, "period": 2},
        {"variance": 0.1, "position": (4.0, 0.0), "range": 6.0},
    ],
}
RADAR = {
    "missed": 0.2,
    "sensors": [
        {"variance": 0.2, "period": 2},
        {
            "range_deviation": 0.3,
            "bearing_deviation": 0.02,
            "rate_deviation": 0.2,
            "position": (9.0, 20.0),
        },
    ],
}
UNITLESS = (
    "log_ratio",
    "innovation_along",
    "innovation_across",
    "log_variance",
    "previous",
    "ticks",
    "ticks_left",
    "log_error_probability",
    "displacement_along",
    "displacement_across",
    "anchor_xx",
)


@pytest.mark.parametrize("bank", ["published", "anchor_aware", "oracle"])
@pytest.mark.parametrize(("length", "time"), [(1e3, 1e-3), (1e-3, 60.0)])
@pytest.mark.parametrize("measured", [{}, SENSED, RADAR], ids=["one sensor", "sensors", "radar"])
def test_quantities_without_units_do_not_depend_on_the_units(bank, length, time, measured):
    # P := I has units; the bank therefore carries its covariance over.
    options = {
        "radii": (3.0, 5.0),
        "speed": 2.0,
        "tau": 0.1,
        "process_variance": 0.001,
        "measurement_variance": 0.1,
        "initial_error": (0.3, 0.02),
        "bank": bank,
        "reset_covariance": False,
        **measured,
    }
    envs = [
        HybridTrackVectorEnv(16, **given) for given in (options, unit_scales(options, length, time))
    ]
    layout = Layout(5)
    results = [env.reset(seed=3)[0] for env in envs]
    generator = np.random.default_rng(4)
    for _ in range(200):
        for name in UNITLESS:
            first, second = (layout.read(rows, name) for rows in results)
            np.testing.assert_allclose(first, second, rtol=1e-4, atol=1e-4, err_msg=name)
        actions = np.where(generator.random(16) < 0.05, generator.integers(1, 6, 16), 0)
        steps = [env.step(actions) for env in envs]
        results = [step[0] for step in steps]
        np.testing.assert_array_equal(steps[0][1], steps[1][1])
