"""Modes of the user in environments: texts, schemes, types and refusals."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hostile_input import refused
from own_modes import Halt
from own_noise import run_page

from hybrid_env import (
    ArgumentError,
    HybridTrackEnv,
    KalmanBank,
    QuickestOptions,
    WorldOptions,
    parse_scheme,
    simulate,
)
from hybrid_env.live import LiveTracks
from hybrid_env.modes import (
    Accelerate,
    Climb,
    LinearMode,
    Stop,
    Stopping,
    Straight,
    Turn,
    TurnRate,
    parse_modes,
)

TEXT = "straight, left 5, right 4, stop, accelerate 0.5, accelerate -0.2, turn rate 0.6, stopping 2"
CLIMBS = "straight, left 5, climb 0.5, descend 0.3"
MODES = (
    Straight(),
    Turn(5.0),
    Turn(-4.0),
    Stop(),
    Accelerate(0.5),
    Accelerate(-0.2),
    TurnRate(0.6),
    Stopping(2.0),
)


def test_a_text_stands_for_modes_which_have_a_text_again():
    assert parse_modes(TEXT) == MODES
    assert ", ".join(map(str, parse_modes(TEXT))) == TEXT
    scheme = WorldOptions(modes=TEXT, scheme="50 straight, 30 stop, 40 accelerate 0.5").scheme
    assert parse_scheme(str(scheme)) == scheme
    for options in (WorldOptions, QuickestOptions):
        assert options(modes=TEXT) == options(modes=MODES) == options(modes=TEXT.split(", "))
        # Straight motion and turns, in the order of radii, are the short form.
        assert options(modes="straight, left 3, left 5, right 3, right 5") == options(radii=(3, 5))


def test_modes_of_the_plane_and_climbs_are_pairs():
    modes = parse_modes(CLIMBS)
    assert ", ".join(map(str, modes)) == (
        "straight level, straight climb 0.5, straight descend 0.3,"
        " left 5 level, left 5 climb 0.5, left 5 descend 0.3"
    )
    assert parse_modes(", ".join(map(str, modes))) == modes
    assert modes == parse_modes([Straight(), Turn(5.0), Climb(0.5), Climb(-0.3)])
    assert modes[1].type == "straight climb"
    # A pair makes the others level.
    pairs = parse_modes("straight, left 5 descend 2")
    assert list(map(str, pairs)) == ["straight level", "left 5 descend 2"]
    scheme = WorldOptions(modes=CLIMBS, scheme="9 left 5 climb 0.5, 30 straight level").scheme
    assert [piece.name for piece in scheme.pieces] == ["left 5 climb 0.5", "straight level"]


def test_simulations_and_live_sensors_refuse_climbs():
    for use in (
        lambda: simulate("9 straight climb 1, 9 straight level", modes="straight, climb 1"),
        lambda: KalmanBank(modes=CLIMBS),
        lambda: LiveTracks(QuickestOptions(modes=CLIMBS)),
    ):
        assert "modes of the plane" in refused(use)


@dataclass(frozen=True)
class HardBrake(Halt):
    """A mode whose class gives its name."""

    share: float = 0.5
    gain: Any = ((1.0, 0.0), (0.0, 1.0))
    place: str = "at a kerb"


def test_the_class_and_its_numbers_name_a_mode():
    assert HardBrake.words == HardBrake().type == "hard brake"
    assert HardBrake().name == "hard brake 0.5"
    assert WorldOptions(modes=(Halt(), HardBrake()), scheme="9 hard brake 0.5").hypotheses == 2


REFUSED = {
    "modes": (
        ({"modes": "straight"}, "['straight'] is not allowed: expected 2 to 1,000 modes"),
        ({"modes": "straight, left"}, "modes='left' is not allowed"),
        ({"modes": "straight, straight"}, "different names"),
        ({"modes": "straight, sideways 3, stop"}, "'sideways 3' is not allowed"),
        ({"modes": (Straight(), 5)}, "modes=5"),
        ({"modes": 5}, "'turn rate 0.2'"),
        ({"modes": (Stop(), LinearMode(np.eye(4), name="stop"))}, "['stop', 'stop']"),
        ({"modes": (Stop(), LinearMode(1.1 * np.eye(4), name="up"))}, "at most 1e9 times"),
        ({"modes": "straight, climb"}, "modes='climb' is not allowed"),
        ({"modes": "straight, climb up"}, "'climb 5'"),
        ({"modes": "straight, sideways climb 2"}, "'sideways climb 2'"),
        ({"modes": "straight, level"}, "2 to 1,000 modes"),
    ),
    "height_variance": (
        ({"modes": "straight, climb 1e9", "height_variance": 1e-9}, "too many standard"),
    ),
    "sensors": (({"modes": CLIMBS, "sensors": ["0.4"]}, "none with modes that climb or"),),
    "scheme": (
        ({"modes": "straight, stop", "scheme": "50 straight, 9 left 5"}, "straight"),
        ({"modes": "straight, stop", "scheme": "L50r5"}, "straight, stop"),
        ({"modes": "straight, stop", "scheme": "straight, stop"}, "'50 straight, 30 stop'"),
        ({"scheme": "50 stop"}, "straight, left 5, right 5"),
        ({"scheme": "50 turn rate 1"}, "straight, left 5, right 5"),
    ),
    "radii": (({"modes": "straight, left 0.001", "tau": 1.0}, "at least 0.02"),),
}


@pytest.mark.parametrize("name", REFUSED)
def test_options_that_are_not_allowed_are_refused_in_one_line(name):
    for given, reason in REFUSED[name]:
        with pytest.raises(ArgumentError) as caught:
            WorldOptions(**given)
        message = str(caught.value)
        assert message.startswith(f"{name}="), message
        assert reason in message
        assert message.isprintable()


@pytest.mark.parametrize("row", [None, 1.0, "stop", [["stop"]], {"stop": "all"}, {"stop": 0.5}])
def test_transitions_by_names_that_are_not_rows_are_refused(row):
    given = {"straight": row, "stop": {"straight": 1.0}}
    message = refused(QuickestOptions, modes="straight, stop", transitions=given)
    assert message.startswith("transitions=")


def test_laws_of_durations_are_given_to_every_mode():
    durations = "straight uniform 5-9, turns uniform 3-4"
    assert QuickestOptions(modes="right 3, straight", durations=durations).law_places.tolist() == [
        1,
        0,
    ]
    message = refused(QuickestOptions, modes="straight, stop", durations=durations)
    assert message.startswith("durations=")
    assert "a law of 'stop'" in message
    more = f"{durations}, stop uniform 6-7"
    message = refused(QuickestOptions, modes="straight, left 3", durations=more)
    assert message.endswith("expected only laws of straight, left 3")


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("F", {"F": np.eye(3)}),
        ("F", {"F": np.full((4, 4), np.nan)}),
        ("B", {"F": np.eye(4), "B": np.zeros(6)}),
        ("Q", {"F": np.eye(4), "Q": -np.eye(4)}),
        ("Q", {"F": np.eye(4), "Q": np.triu(np.ones((4, 4)))}),
        ("name", {"F": np.eye(4), "name": "a, b"}),
    ],
)
def test_matrices_that_are_not_allowed_are_refused_in_one_line(name, given):
    assert refused(LinearMode, **given).startswith(f"{name}=")


@dataclass(frozen=True)
class Wrong(Halt):
    """A mode whose matrices are not those of a mode."""

    kind: str = ""

    def matrices(self, tau):
        """Return F of three states, nothing, or fail."""
        if self.kind == "three":
            return np.eye(3), np.zeros(4), None
        return tau / 0.0 if self.kind == "fails" else None


@pytest.mark.parametrize(
    ("kind", "reason"),
    [("three", "not (3, 3)"), ("none", "NoneType"), ("fails", "division by zero")],
)
def test_matrices_of_a_class_are_checked_too(kind, reason):
    message = refused(HybridTrackEnv, modes=(Straight(), Wrong(kind)))
    assert message.startswith("modes='wrong")
    assert reason in message


@pytest.mark.parametrize("size", [1e6, 1e12, 1e30])
@pytest.mark.parametrize("kept", [0.0, 1.0])
def test_a_mode_that_grows_without_large_eigenvalues_is_refused(size, kept):
    for n in (4, 6):
        mode = LinearMode(kept * np.eye(n) + size * np.eye(n, k=1), name="shear")
        for options in (WorldOptions, QuickestOptions):
            assert "at most 1e9 times" in refused(options, modes=(Straight(), mode))


def test_the_modes_of_the_page_move_the_object_as_it_says():
    boat = run_page()["boat"].unwrapped.options
    assert boat.type_names == ("straight", "stop", "drag", "current")
    run = simulate(str(boat.scheme), modes=boat.modes)
    way = np.hypot(*np.diff(run.truth[0, :, ::2], axis=0).T)
    first, second = np.cumsum([piece.length for piece in boat.scheme.pieces])[:2]
    # 5 % a tick, with noise of the velocities; and 0.1 m a tick.
    assert way[first + 28] < 0.5 * way[first]
    assert way[second + 19] == pytest.approx(0.1)
