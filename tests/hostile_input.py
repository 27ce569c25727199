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
    False,
    0,
    1,
    -1,
    2,
    7,
    1.5,
    1e-300,
    1e308,
    2**31,
    10**9,
    10**15,
    10**30,
    10**400,
    float("nan"),
    float("inf"),
    -float("inf"),
    "",
    "1",
    "1e400",
    "lin_1",
    "ppo",
    "anchor",
    "x" * 20_000,
    "\ud800",
    "a\nb[/b]",
    "../..",
    "/dev/zero",
    [],
    {},
    [None],
    [[]],
    [1] * 3000,
    [10**9],
    {"a": 1},
    {"trace_rows": 10**9},
    {"n_envs": 10**9},
    "random 1000000x1000000",
    "S1000000",
    [5.0, 5.0],
    [10**9] * 9,
]
NESTED: list = []
for _ in range(200):
    NESTED = [NESTED]
VALUES.append(NESTED)


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
    """The bytes, some replaced, inserted, removed, cut off or flipped; more often near the
    start.
    """
    content = bytearray(content)
    last = draw(st.sampled_from([16, 200, len(content)]))
    for _ in range(draw(st.integers(1, 4))):
        at = draw(
            st.integers(
                0,
                max(0, min(last, len(content)) - 1),
            )
        )
        change = draw(st.sampled_from(["replace", "insert", "remove", "cut", "repeat", "flip"]))
        some = draw(
            st.binary(min_size=1, max_size=8) | st.sampled_from([b"\0", b"\n", b'"', b"[" * 3000])
        )
        if change == "replace":
            content[at : at + len(some)] = some
        elif change == "insert":
            content[at:at] = some
        elif change == "remove":
            del content[at : at + draw(st.integers(1, 64))]
        elif change == "cut":
            del content[at:]
        elif change == "flip" and content:
            content[at] ^= 1 << draw(st.integers(0, 7))
        else:
            content[at:at] = content[at : at + 64] * draw(st.integers(1, 50))
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
    # Also no line break.
    assert message.isprintable()
    assert "expected" in message
    return message


def counts(quick, study=100_000):
    """Numbers of cases of an attack, to parametrize its test: few, and many in `make study`."""
    return [quick, pytest.param(study, marks=pytest.mark.study)]
