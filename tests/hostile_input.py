"""Hostile input for property tests: one value of a document replaced, bytes of a file replaced.

Each test checks `refused_in_one_line` for a few hundred examples, and for many in `make study`.
"""

import copy
import resource
import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hybrid_env.checks import ArgumentError

# Characters of a message.
LONGEST = 300
CPU_SECONDS = 2.0
# Bytes.
MEMORY = 1_000_000_000

VALUES = [
    None,
    True,
    0,
    -1,
    7,
    1.5,
    1e-300,
    1e308,
    10**9,
    10**30,
    float("nan"),
    -float("inf"),
    "",
    "1",
    "lin_1",
    "ppo",
    "x" * 20_000,
    "\ud800",
    "a\nb[/b]",
    "/dev/zero",
    [],
    {},
    [[]],
    [1] * 3000,
    {"a": 1},
    {"n_envs": 10**9},
    "random 1000000x1000000",
    [10**9] * 9,
]


def profile(examples):
    """Settings of a property test with so many examples."""
    return settings(
        max_examples=examples,
        deadline=None,
        derandomize=examples < 1_000,
        database=None,
        suppress_health_check=list(HealthCheck),
    )


def attack(examples, values, use):
    """Call a function with so many of the values of a strategy."""
    profile(examples)(given(values)(use))()


def places(document):
    """Paths of all values inside a document of dictionaries and lists, with that of the document
    itself.
    """
    inner = {}
    if isinstance(document, dict | list):
        inner = document if isinstance(document, dict) else dict(enumerate(document))
    return [()] + [(key, *rest) for key, value in inner.items() for rest in places(value)]


@st.composite
def mutated(draw, document):
    """The document with one value replaced, removed, or joined by an unknown name."""
    path = draw(st.sampled_from(places(document)))
    value = draw(st.sampled_from(VALUES) | st.integers() | st.floats() | st.text(max_size=20))
    change = draw(st.sampled_from(["replace", "replace", "remove", "add"]))
    if not path:
        return value
    result = copy.deepcopy(document)
    place = result
    for key in path[:-1]:
        place = place[key]
    if change == "remove":
        del place[path[-1]]
    elif change == "add" and isinstance(place, dict):
        place[draw(st.text(max_size=5) | st.just("trace_rows"))] = value
    else:
        place[path[-1]] = value
    return result


@st.composite
def damaged(draw, content):
    """The bytes, some replaced, inserted or removed; more often near the start."""
    content = bytearray(content)
    last = draw(st.sampled_from([16, 200, len(content)]))
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(0, min(last, len(content)) - 1)))
        removed = draw(st.sampled_from([0, 1, 64, len(content)]))
        added = draw(st.binary(max_size=8) | st.sampled_from([b"\0", b"\n", b'"', b"[" * 3000]))
        content[at : at + removed] = added
    return bytes(content)


def accepted(action):
    """Run an action; return its result, or None if it raised an `ArgumentError` with one short
    line.

    Fails if the action takes too much processor time or memory. Any other exception ends the test.
    """
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    started = time.process_time()
    try:
        return action()
    except ArgumentError as error:
        message = str(error)
        assert "\n" not in message
        assert len(message) <= LONGEST
        return None
    finally:
        assert time.process_time() - started < CPU_SECONDS
        assert 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) < MEMORY


def refused(function, *arguments, **keywords):
    """Call a function, which refuses its arguments, and return the message."""
    with pytest.raises(ArgumentError) as caught:
        function(*arguments, **keywords)
    message = str(caught.value)
    assert len(message) <= LONGEST
    # There is no line break either.
    assert message.isprintable()
    assert "expected" in message
    return message


def counts(quick, study=100_000):
    """Numbers of cases of an attack, to parametrize its test: few, and many in `make study`."""
    return [quick, pytest.param(study, marks=pytest.mark.study)]
