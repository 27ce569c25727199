"""Options are plain values that do not change later, inside ranges that no unit of measurement
leaves.
"""

import copy
import dataclasses
import datetime
import decimal
import fractions
import functools
import math
import pickle

import numpy as np
import pytest
from hostile_input import refused
from random_worlds import unit_scales

from hybrid_env import (
    FixedScheme,
    HybridTrackVectorEnv,
    Layout,
    QuickestOptions,
    RandomScheme,
    Segment,
    WorldOptions,
    parse_scheme,
)
from hybrid_env.limits import LARGEST_TURN, MAX_PIECES, MAX_RADII, RANGES
from hybrid_env.noises import GaussianNoise, LevyNoise, Noise, OutlierNoise, StudentNoise
from hybrid_env.simulation import simulate


def plain(value):
    """Return True if a value consists of plain Python values."""
    if isinstance(value, tuple):
        return all(map(plain, value))
    if isinstance(value, (FixedScheme, RandomScheme, Segment)):
        return plain(tuple(vars(value).values()))
    return type(value) in (float, int, str, bool, type(None), GaussianNoise)


ACCEPTED = [
    {},
    {"measurement_variance": np.array([0.1, 0.2]), "radii": np.array([3, 5])},
    {
        "measurement_variance": np.float32(0.5),
        "radii": [3, np.int8(5)],
        "speed": np.int64(3),
    },
    {
        "measurement_variance": np.array(0.1),
        "initial_error": np.zeros(2),
        "radii": 5,
    },
    {
        "initial_error": [0, np.float32(0.5)],
        "reset_covariance": np.bool_(True),
        "bank": np.str_("published"),
    },
    {
        "scheme": FixedScheme(
            [Segment("S", np.int8(5)), Segment("L", np.uint64(9), np.float32(5.0))]
        )
    },
    {
        "scheme": RandomScheme(
            np.int16(3),
            [np.int8(5), 9],
            np.array([5.0]),
        )
    },
    {"scheme": RandomScheme(3, np.array([5, 9]), [5])},
    {
        "radii": range(5, 7),
        "measurement_variance": (0.1, 0.1),
        "heading": fractions.Fraction(1, 3),
    },
]


@pytest.mark.parametrize("given", ACCEPTED)
def test_values_are_stored_as_plain_python_values(given):
    options = WorldOptions(**given)
    assert plain(tuple(vars(options).values()))
    assert pickle.loads(pickle.dumps(options)) == options
    assert hash(options) == hash(copy.deepcopy(options))


RAGGED = [[1.0, 2.0], [3.0]]
MASKED = np.ma.array([0.1, 0.2], mask=[False, True])
NASTY = [
    None,
    True,
    "5",
    "",
    "5" * 5000,
    b"5",
    math.nan,
    math.inf,
    -math.inf,
    -1.0,
    10**400,
    -(10**400),
    decimal.Decimal(1),
    1 + 0j,
    RAGGED,
    [],
    (),
    [[]],
    {},
    {1.0, 2.0},
    object(),
    Exception,
    len,
    datetime.timedelta(1),
    np.timedelta64(1, "s"),
    np.datetime64("2020-01-01"),
    MASKED,
    np.ma.masked,
    np.zeros(0),
    np.ones((2, 2)),
    np.array("x"),
    np.array([None, 1.0]),
    np.array([1.0, "x"], object),
    np.longdouble("1e4000"),
    [1.0, math.nan],
    (1.0, 2.0, 3.0, 4.0, True),
    ["1", "2"],
    1e300,
    [1e300, 1e-300],
    fractions.Fraction(10**400, 3),
    iter([1.0, 2.0]),
    "\n" * 500,
    "\U0001d7dd",
    "ß" * 1000,
    np.recarray(2, "f8,f8"),
]
NUMBERS = [
    "radii",
    "speed",
    "heading",
    "tau",
    "process_variance",
    "object_variance",
    "measurement_variance",
    "missed",
    "initial_error",
    "delay_cost",
    "evidence",
]
WORDS = [
    "scheme",
    "noise",
    "likelihood",
    "bank",
    "reset_covariance",
    "follow",
    "correctness",
    "actions",
    "observation",
    "undecided",
    "recalculation",
    "refine_radius",
]


def test_every_option_is_tested():
    assert {*NUMBERS, *WORDS, "sensors"} == {
        field.name for field in dataclasses.fields(WorldOptions)
    }


@pytest.mark.parametrize("name", NUMBERS + WORDS)
def test_values_of_other_types_are_refused_in_one_line(name):
    for value in NASTY:
        allowed = {
            "heading": (None, -1.0),
            "object_variance": (None,),
            "reset_covariance": (None, True),
            "recalculation": (True,),
        }.get(
            name,
            (),
        )
        if any(value is one for one in allowed):
            continue
        message = refused(WorldOptions, **{name: value})
        assert message.startswith(name), message


SCHEMES = [
    "S" + "9" * 4400,
    "L5r" + "9" * 4400,
    "random " + "9" * 4400 + "x5",
    "random 5x" + "9" * 4400,
    "S5 " * (MAX_PIECES + 1),
    "S" + "5" * 4400 + "x",
    "L50r0",
    "L50r" + "0" * 400 + "1" * 400,
    "S1000001",
    "random 1000001x5",
    "random 5x1000001",
    "S٣",
    "S5\x00",
    "S5\n\nX" * 100,
    "'" * 400,
    "",
    "   ",
    "X50",
    "S",
    "S0",
    "S50r3",
    "L50",
    "L50r-1",
    "Lr5",
    "S50 L50",
    "L50rx",
    "S5.5",
    "random 0x5",
    "random 3x9-5",
    "random x",
    "S99999999",
    "nonsense",
    None,
    5,
    [],
    ("S50",),
    b"S50",
]


@pytest.mark.parametrize("scheme", SCHEMES, ids=range(len(SCHEMES)))
def test_other_texts_and_values_of_a_scheme_are_refused(scheme):
    refused(parse_scheme, scheme)
    refused(WorldOptions, scheme=scheme)


OUTSIDE = [
    {
        "speed": 3e5,
        "radii": 1.0,
        "tau": 1.0,
    },
    {"speed": 1e16},
    {"tau": 1e20},
    {"radii": 1e-12},
    {"measurement_variance": 1e-40},
    {"measurement_variance": (0.1, 1e-41)},
    {"radii": 1e13},
    {"process_variance": 1e19},
    {"delay_cost": 1e7},
    {"heading": 1e7},
    {"initial_error": (1e13, 0.0)},
    {"initial_error": (0.0, 1e19)},
    {"speed": 1e-10},
    {"tau": 1e-10},
    {"radii": range(1, MAX_RADII + 2)},
    {"scheme": "L5r0.001", "correctness": "type"},
    {"scheme": "L5r1000000000000", "correctness": "type"},
    {"scheme": RandomScheme(radii=(1e-3, 5.0)), "correctness": "type"},
    {
        "process_variance": 1e18,
        "tau": 1.0,
        "measurement_variance": 1e-3,
    },
    {
        "initial_error": (0.0, 1e18),
        "tau": 1.0,
        "measurement_variance": 1e-3,
    },
    {"radii": 0.0},
    {"radii": -5.0},
    {"radii": (5.0, 5.0)},
    {"radii": ((5.0,),)},
    {"speed": 0.0},
    {"tau": 0.0},
    {"tau": [0.1]},
    {"process_variance": -1e-9},
    {"measurement_variance": 0.0},
    {"measurement_variance": (0.1, 0.0)},
    {"initial_error": 0.5},
    {"initial_error": (0.3,)},
    {"initial_error": (-0.3, 0.0)},
    {"initial_error": (math.nan, 0.0)},
    {"noise": "outliers -0.1"},
    {"noise": "outliers 1"},
    {"noise": "levy 3"},
    {"sensors": "radar"},
    {"sensors": [5]},
    {"missed": 1.0},
    {"delay_cost": -0.01},
    {"bank": "aware"},
    {"bank": 1},
    {"reset_covariance": 1},
    {"follow": "both"},
    {"correctness": "approximate"},
    {"actions": "some"},
    {"undecided": "forget"},
    {"observation": "pixels"},
    {"evidence": 1.0},
    {"evidence": -0.1},
    {"evidence": 95},
    {"refine_radius": True},
    {"recalculation": True, "follow": "bank"},
    {"reset_covariance": True, "bank": "oracle"},
    {
        "refine_radius": True,
        "follow": "bank",
        "radii": (2.0, 5.0),
    },
]


@pytest.mark.parametrize("given", OUTSIDE, ids=range(len(OUTSIDE)))
def test_values_outside_the_range_are_refused_with_the_range(given):
    message = refused(WorldOptions, **given)
    assert any(
        name in message.partition("=")[0] for name in ("radii", "measurement_variance", *given)
    )


def own_law(base, example, law, numbers):
    """Return a law that is not one of the package: a subclass of a class of `hybrid_env.noises`."""
    return type(
        "OwnNoise",
        (base,),
        {
            "example": example,
            "law": law,
            "numbers": numbers,
        },
    )


def changed(law, **numbers):
    """Return a law whose numbers were replaced after their check."""
    for name, number in numbers.items():
        object.__setattr__(law, name, number)
    return law


OWN_LAWS = {
    "unknown number": own_law(Noise, "own", 4, (0.0, 1.0, math.inf))(),
    "negative number": own_law(Noise, "own", -1, (0.0, 1.0, math.inf))(),
    "number of a text": own_law(Noise, "own", "4", (0.0, 1.0, math.inf))(),
    "known number": own_law(Noise, "own", 2, (1.5, 1.0, 44.0))(),
    "name of a law": own_law(Noise, "gaussian", 9, (0.0, 1.0, math.inf))(),
    "too few parameters": own_law(Noise, "own", 1, (0.0,))(),
    "too many parameters": own_law(Noise, "own", 1, (0.0, 1.0, 2.0, 3.0))(),
    "not finite": own_law(
        Noise,
        "own",
        2,
        (math.nan, math.inf, math.nan),
    )(),
    "nothing declared": type("OwnNoise", (Noise,), {})(),
    "of normal noise": own_law(GaussianNoise, "gaussian", 0, (0.0, 2.0, math.inf))(),
    "of a law with numbers": own_law(LevyNoise, "levy 1.5 1 44", 9, ("index", "scale", "clip"))(
        1.5
    ),
    "the base": Noise(),
    "a class": GaussianNoise,
}
CHANGED_LAWS = {
    "NaN": changed(StudentNoise(3.0), freedom=math.nan),
    "infinite": changed(OutlierNoise(0.1), ratio=math.inf),
    "out of range": changed(LevyNoise(1.5), index=9.0),
    "a text": changed(LevyNoise(1.5), clip="44"),
}


@pytest.mark.parametrize(
    "law",
    (OWN_LAWS | CHANGED_LAWS).values(),
    ids=OWN_LAWS | CHANGED_LAWS,
)
@pytest.mark.parametrize(
    "use",
    [WorldOptions, QuickestOptions, functools.partial(simulate, "S9")],
    ids=["world", "quickest", "simulate"],
)
def test_a_law_of_noise_that_the_kernel_cannot_draw_is_refused(use, law):
    refused(use, noise=law)


@pytest.mark.parametrize("law", OWN_LAWS.values(), ids=OWN_LAWS)
def test_a_bank_cannot_assume_an_own_law_of_noise(law):
    refused(WorldOptions, likelihood=law)


@pytest.mark.parametrize(
    "law",
    [
        GaussianNoise(),
        OutlierNoise(0.1),
        LevyNoise(1.5, 1.0, 44.0),
        StudentNoise(3.0),
    ],
)
def test_a_law_of_noise_of_the_package_is_stored_as_it_is(law):
    assert WorldOptions(noise=law).noise == law == WorldOptions(noise=str(law)).noise


def test_values_at_the_limits_are_accepted():
    # No ratio is too large.
    others = {
        "radii": 100.0,
        "speed": 1e-6,
        "tau": 1e-6,
    }
    names = (
        "speed",
        "tau",
        "process_variance",
        "measurement_variance",
        "delay_cost",
        "heading",
        "evidence",
    )
    for name in names:
        for value in RANGES[name]:
            assert getattr(WorldOptions(**others | {name: value}), name) == value

    assert WorldOptions(speed=LARGEST_TURN, tau=1.0, radii=1.0)
    refused(WorldOptions, speed=LARGEST_TURN * 1.001, tau=1.0, radii=1.0)


SENSED = {
    "missed": 0.2,
    "noise": "student_t 3",
    "sensors": [
        {"variance": 0.2, "period": 2},
        {
            "variance": 0.1,
            "position": (4.0, 0.0),
            "range": 6.0,
        },
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
@pytest.mark.parametrize(
    ("length", "time"),
    [(1e3, 1e-3), (1e-3, 60.0), (1e5, 1e5)],
)
@pytest.mark.parametrize(
    "measured",
    [{}, SENSED, RADAR],
    ids=["one sensor", "sensors", "radar"],
)
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
        HybridTrackVectorEnv(16, **one) for one in (options, unit_scales(options, length, time))
    ]
    layout = Layout(5)
    results = [env.reset(seed=3)[0] for env in envs]
    generator = np.random.default_rng(4)
    for _ in range(200):
        for name in UNITLESS:
            first, second = (layout.read(rows, name) for rows in results)
            np.testing.assert_allclose(
                first,
                second,
                rtol=1e-4,
                atol=1e-4,
                err_msg=name,
            )
        actions = np.where(
            generator.random(16) < 0.05,
            generator.integers(1, 6, 16),
            0,
        )
        steps = [env.step(actions) for env in envs]
        results = [step[0] for step in steps]
        np.testing.assert_array_equal(steps[0][1], steps[1][1])
