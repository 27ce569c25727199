"""A live tracker from a `track.json`, which may be damaged or of someone else."""

import json

import pytest
from hostile_input import accepted, attack, mutated

from baselines import OnlineTracker
from hybrid_env.checks import ArgumentError

SETTINGS = {
    "object": "a",
    "projection": {"latitude": 50.0, "longitude": 10.0},
    "radar": None,
    "wind": [0.0, 0.0],
    "tick": 0.5,
    "gap": 10.0,
    "measurement_variance": 0.01,
    "process_variance": 3e-6,
    "drift_variance": 0.0,
    "radii": [10.0],
    "modes": [],
    "duration": 56.5,
    "speed": 2.0,
    "durations": None,
    "ticks": 400,
    "decider": "steady:0.75",
    "known_switches": False,
}
WRONG = {
    "text of a latitude": (
        "latitude",
        {"projection": {"latitude": "0 +proj=merc", "longitude": 1}},
    ),
    "a latitude of no place": ("latitude", {"projection": {"latitude": 1e9, "longitude": 1}}),
    "an unknown field": ("projection", {"projection": {"x": 1}}),
    "no variance": ("measurement_variance", {"measurement_variance": 0}),
    "a tiny variance": ("measurement_variance", {"measurement_variance": 1e-308}),
    "a large integer": ("recording", {"speed": 10**49}),
    "a text as a number": ("tick", {"tick": "0.5"}),
    "a threshold that is none": ("decider", {"decider": "threshold:x"}),
    "a threshold out of range": ("threshold|probability|p=", {"decider": "threshold:nan"}),
    "known switches": ("known_switches", {"known_switches": True}),
    "a missing field": ("gap", {"gap": ...}),
}


@pytest.fixture
def tracker_of(tmp_path):
    """Return a function that writes a track.json and returns its tracker."""

    def tracker_of(settings):
        path = tmp_path / "track.json"
        text = settings if isinstance(settings, str) else json.dumps(settings)
        path.write_text(text, encoding="utf-8", errors="replace")
        return OnlineTracker.from_recording(path)

    return tracker_of


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_value_is_refused_by_its_name(tracker_of, kind):
    name, values = WRONG[kind]
    settings = {key: value for key, value in (SETTINGS | values).items() if value is not ...}
    with pytest.raises(ArgumentError, match=name) as caught:
        tracker_of(settings)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("text", ["[" * 20_000, "[]", "", '{"tick": NaN}', " " * 2**21])
def test_what_is_no_small_json_is_refused(tracker_of, text):
    with pytest.raises(ArgumentError, match=r"(a|no) track\.json"):
        tracker_of(text)


def test_a_damaged_file_gives_a_tracker_or_one_line(tracker_of):
    # Its code is compiled.
    tracker_of(SETTINGS)

    def check(settings):
        tracker = accepted(lambda: tracker_of(settings))
        for k in range(6 * (tracker is not None)):
            tracker.update((50.0 + 1e-5 * k, 10.0), 0.5 * k)

    attack(60, mutated(SETTINGS), check)
