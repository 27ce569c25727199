"""Random values of options: a world is refused in one line, or its rows are in the observation
space.
"""

import dataclasses
import datetime
import decimal
import functools
import math
import time

import gymnasium as gym
import numpy as np
import pytest
from hostile_input import profile
from hypothesis import given, settings
from hypothesis import strategies as st
from random_worlds import random_options, soak

from hybrid_env import FixedScheme, RandomScheme, Segment, WorldOptions
from hybrid_env.checks import ArgumentError
from hybrid_env.limits import RANGES
from hybrid_env.noises import GaussianNoise, LevyNoise, Noise, OutlierNoise, StudentNoise
from hybrid_env.registration import ENVIRONMENTS, environment_options

NAMES = sorted(field.name for field in dataclasses.fields(WorldOptions))
LIMITS = sorted({value for pair in RANGES.values() for value in pair})

numbers = st.one_of(
    st.floats(),
    st.integers(-(10**20), 10**20),
    st.sampled_from([0, 1, -1, 10**400, True, 5e-324, 1.8e308, math.pi, *LIMITS]),
    st.sampled_from(LIMITS).map(lambda value: float(np.nextafter(value, math.inf))),
    st.sampled_from(LIMITS).map(lambda value: float(np.nextafter(value, -math.inf))),
    st.sampled_from([np.int8, np.uint64, np.float16, np.float32, np.longdouble]).map(
        lambda kind: kind(3)
    ),
    st.decimals(),
    st.fractions(),
)
sequences = st.one_of(
    st.lists(numbers, max_size=4),
    st.tuples(numbers, numbers),
    st.lists(st.floats(), max_size=4).map(np.array),
    st.lists(st.floats(), max_size=3).map(
        lambda values: np.ma.array(values, mask=[True] * len(values))
    ),
    st.floats().map(np.array),
    st.lists(st.lists(numbers, max_size=2), max_size=2),
    st.sets(st.floats(), max_size=3),
)
words = st.one_of(
    st.text(),
    st.text("SLRr0123456789.x-random e", max_size=40),
    st.from_regex(r"\A([SLR][0-9]{1,8}(r[0-9.]{1,8})?[ ,;]?){1,5}\Z"),
    st.from_regex(r"\Arandom [0-9]{1,8}x[0-9]{1,8}(-[0-9]{1,8})?\Z"),
    st.integers(1, 6000).map(lambda digits: "S" + "9" * digits),
    st.sampled_from(
        ["published", "anchor_aware", "oracle", "exact", "type", "best", "keep", "declared"]
    ),
)
others = st.one_of(
    st.none(),
    st.binary(),
    st.timedeltas(),
    st.datetimes(),
    st.complex_numbers(),
    st.dictionaries(st.text(), numbers, max_size=2),
    st.sampled_from(
        [object(), len, int, np.timedelta64(5, "s"), decimal.Decimal(5), datetime.date(2020, 1, 1)]
    ),
)


@st.composite
def laws(draw):
    """Return a law of noise, of the package or an own subclass, whose numbers may have been
    replaced.
    """
    base = draw(st.sampled_from([Noise, GaussianNoise, OutlierNoise, LevyNoise, StudentNoise]))
    own = {
        "example": draw(st.text()),
        "law": draw(numbers),
        "numbers": draw(st.tuples(numbers, numbers, numbers)),
    }
    law = object.__new__(type("OwnNoise", (base,), own) if draw(st.booleans()) else base)
    for field in dataclasses.fields(base):
        object.__setattr__(law, field.name, draw(numbers))
    return law


values = st.one_of(numbers, sequences, words, others, laws())


@st.composite
def schemes(draw):
    """Return a scheme object or the arguments of an invalid one."""
    if draw(st.booleans()):
        piece = st.tuples(st.sampled_from("SLR"), numbers, st.none() | numbers)
        return FixedScheme, [draw(st.lists(piece, max_size=4))]
    return RandomScheme, [draw(numbers), draw(sequences), draw(st.none() | sequences)]


def check(build, seconds=2.0):
    """Build options, or check their refusal. Returns None if they are refused."""
    start = time.process_time()
    options = None
    refusal = None
    try:
        options = build()
    except (ArgumentError, TypeError) as error:
        refusal = error
    assert time.process_time() - start < seconds
    if refusal is not None:
        message = str(refusal)
        assert isinstance(refusal, ArgumentError) or "unexpected keyword" in message, message
        # The longest names all options.
        assert len(message) <= 350, message
        assert len(message.splitlines()) == 1, message
    return options


def affordable(options):
    """Return True if a few steps of the world, including decisions, take little time."""
    return options.longest_segment * options.hypotheses <= 20_000


def check_world(keywords):
    """Refuse the keywords of a world, or step it from an episode start."""
    options = check(lambda: WorldOptions.of(**keywords))
    if options is not None and affordable(options):
        soak(keywords, tracks=3, ticks=30, seed=1)


def check_scheme(parts):
    """Refuse a scheme object, or step a world with it."""
    kind, arguments = parts

    def build():
        if kind is FixedScheme:
            return FixedScheme([Segment(*piece) for piece in arguments[0]])
        return RandomScheme(*arguments)

    scheme = check(build)
    if scheme is not None:
        check_world(
            {
                "scheme": scheme,
                "correctness": "type",
                "speed": 1e-3,
            }
        )


def check_env(env_id, tracks, name, value):
    """Refuse a keyword of `gym.make` or a seed, or step the environment."""
    cls = environment_options(env_id)
    given = {name: value} if name in OF_ENV[env_id] else {}
    options = check(lambda: cls.of(**(ENVIRONMENTS[env_id] | given)))
    if options is None or not affordable(options):
        return
    given |= {name: value} if name != "seed" and (tracks or name not in OF_VECTOR) else {}
    make = (
        functools.partial(gym.make_vec, env_id, tracks)
        if tracks
        else functools.partial(gym.make, env_id)
    )
    # May compile.
    env = check(lambda: make(**given), 60.0)
    start = env and check(lambda: env.reset(seed=value if name == "seed" else 0))
    if start is not None:
        env.action_space.seed(0)
        for _ in range(3):
            row, reward, terminated, _, _ = env.step(env.action_space.sample())
            assert row in env.observation_space
            assert np.isfinite(reward).all()
            # An episode of one tick.
            if np.any(terminated):
                env.reset()


def check_value(seed, name, value):
    """Check a random world with one of its values replaced, or with one more."""
    check_world(random_options(np.random.default_rng(seed), longest=20) | {name: value})


NUMBERS = ["heading", "measurement_variance", "process_variance", "radii", "speed", "tau"]
OF_VECTOR = ["autoreset_mode", "tick_info", "trace_rows", "threads"]
OF_ENV = {
    one: [field.name for field in dataclasses.fields(environment_options(one))]
    for one in ENVIRONMENTS
}
PLACES = [
    (one, tracks, name)
    for one in ENVIRONMENTS
    for tracks in (0, 3)
    for name in (*OF_ENV[one], *OF_VECTOR, "seed")
]
KINDS = {
    "noise": (lambda law: check_world({"scheme": "random 3x1-5", "noise": law}), [laws()]),
    "gym.make": (lambda place, value: check_env(*place, value), [st.sampled_from(PLACES), values]),
    "one value": (
        check_value,
        [st.integers(0, 2**32), st.sampled_from(NAMES) | st.text(min_size=1), values],
    ),
    "numbers": (
        lambda keywords: check_world({"scheme": "random 3x1-5"} | keywords),
        [st.dictionaries(st.sampled_from(NUMBERS), numbers, max_size=3)],
    ),
    "scheme": (check_scheme, [schemes()]),
}
SIZES = {
    "quick": dict.fromkeys(KINDS, 120),
    "study": dict.fromkeys(KINDS, 20_000) | dict.fromkeys(["gym.make", "one value"], 100_000),
}


@pytest.mark.parametrize(
    "size",
    ["quick", pytest.param("study", marks=pytest.mark.study)],
)
@pytest.mark.parametrize("kind", KINDS)
def test_random_options_are_refused_in_one_line_or_their_world_stays_in_its_space(kind, size):
    run, strategies = KINDS[kind]
    settings(profile(SIZES[size][kind]), derandomize=True)(given(*strategies)(run))()
