"""Options: plain values checked by their declared types, and what does not fit together."""

import fractions
import pickle
import re

import numpy as np
import pytest
from declared import refuse_beyond
from hostile_input import refused

from hybrid_env import (
    FixedScheme,
    QuickestOptions,
    Radar,
    RandomScheme,
    Segment,
    Sensor,
    WorldOptions,
    parse_scheme,
)
from hybrid_env.durations import GeometricDurations, UniformDurations
from hybrid_env.modes import Accelerate, Stopping, Turn, TurnRate, modes_of_radii
from hybrid_env.noises import LevyNoise, OutlierNoise, StudentNoise
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
    Turn: {"radius": 1.0},
    TurnRate: {"rate": 1.0},
    Accelerate: {"acceleration": 1.0},
    Stopping: {"time": 1.0},
    Sensor: {"variance": 1.0},
    Radar: {"range_deviation": 1.0, "bearing_deviation": 0.1},
}
"""Dataclasses with declared fields, and their fields without a default."""


@pytest.mark.parametrize("kind", DECLARED)
def test_values_beyond_the_declared_ones_are_refused_in_one_line_that_names_the_field(kind):
    assert refuse_beyond(kind, **DECLARED[kind]) > 5


def test_values_are_stored_as_plain_python_values():
    given = {
        "measurement_variance": np.array([0.1, 0.2]),
        "radii": np.array([3, 5]),
        "speed": np.int64(3),
        "initial_error": [0, np.float32(0.5)],
        "reset_covariance": np.bool_(True),
        "bank": np.str_("published"),
        "heading": fractions.Fraction(1, 3),
        "scheme": FixedScheme([Segment("S", np.int8(5)), Segment("L", 9, np.float32(5.0))]),
    }
    options = WorldOptions(**given)
    assert not re.search(r"np\.|array|Fraction", repr(options))
    assert pickle.loads(pickle.dumps(options)) == options


def test_a_radar_with_a_range_rate_alone_is_refused():
    assert "bearing_deviation" in refused(Radar, rate_deviation=1.0)


def test_options_that_do_not_fit_together_are_refused_by_name():
    for given in (
        {"scheme": "S" + "9" * 4400},
        {"radii": 1.0, "speed": 100.1, "tau": 1.0},
        {"reset_covariance": True, "bank": "oracle"},
        {"radii": (5.0,), "scheme": "L50r3"},
        {"scheme": "random radii"},
    ):
        assert refused(WorldOptions, **given).partition("=")[0] == next(iter(given))


def test_a_text_stands_for_a_scheme_which_has_a_text_again():
    for text, scheme in (
        ("L50r3 S50", FixedScheme((Segment("L", 50, 3.0), Segment("S", 50)))),
        ("random 2x30", RandomScheme(2, (30, 30))),
        ("random 4x20-60 radii 2.5 10", RandomScheme(4, (20, 60), (2.5, 10.0))),
    ):
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
    scheme = parse_scheme("S10 L10r3 R10r3 L10r2.9 R10r100")
    table = segment_table(scheme, modes_of_radii((1.0, 3.0, 10.0)))
    assert table[:, 1].tolist() == [0, 2, 5, 2, 6]
    # Not to one that a turn before it was mapped to.
    table = segment_table(parse_scheme("L10r7.4 L10r6.5"), modes_of_radii((5.0, 10.0)))
    assert table[:, 1].tolist() == [2, 1]
    table = segment_table(RandomScheme(), modes_of_radii((1.0, 3.0)))
    assert table[:, 1].tolist() == [0, 1, 2, 3, 4]
