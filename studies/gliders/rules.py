"""Rules that tell when a glider circles, and on which side: by turn rate, by angle, by filters.

A rule has several numbers, and a grid of settings from which a comparison selects on other flights.
"""

from dataclasses import replace
from itertools import product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from studies.flights.tracks import FlightTracks
from studies.flights.turn_beam import TurnHistories
from studies.flights.turns import LEFT, RIGHT, STRAIGHT, FloatArray, IntArray, TurnModel

Grid = tuple[tuple[float, ...], ...]

RATES = (0.0, 10.0, 16.0, 24.0, -10.0, -16.0, -24.0)
"""Turn rates of the filters [deg/s]."""

MODELS = tuple(
    TurnModel(
        rates=RATES,
        acceleration=acceleration,
        straight=straight,
        turn=turn,
        within=10.0,
    )
    for acceleration, straight, turn in ((3, 60, 45), (2, 60, 45), (3, 200, 45), (6, 200, 100))
)


class GliderRule:
    """A rule on flights of gliders, at K settings.

    Args:
        settings: K tuples of the numbers of the rule; without any the usual one.

    Attributes:
        numbers: names of the numbers.
        usual: for about five false changes an hour on the open logs.
        grid: settings to select from.
        models: settings of the filters to select from; the first is the usual one.
        histories: settings of the beam; None for the IMM.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    numbers: ClassVar[tuple[str, ...]]
    usual: ClassVar[tuple[float, ...]]
    grid: ClassVar[Grid]
    models: ClassVar[tuple[TurnModel, ...]] = MODELS[:1]
    histories: ClassVar[TurnHistories | None] = None

    def __init__(self, *settings: tuple[float, ...]):
        # (numbers, 1, K)
        self.values = np.array(settings or (self.usual,)).T[:, None]

    def statements(self, tracks: FlightTracks) -> NDArray[np.int8]:
        """Return the statements (T, B, K) on tracks, at first straight motion."""
        seen = self.observe(tracks)
        stated = np.empty(
            (*seen.shape[:2], self.values.shape[-1]),
            np.int8,
        )
        state = self.begin(stated.shape[1:])
        for tick, values in enumerate(seen):
            state = self.step(values, *state)
            stated[tick] = state[0]
        return stated

    def observe(self, tracks: FlightTracks) -> FloatArray:
        """Return what the rule reads: log-probabilities of the modes, (T, B, 3)."""
        return tracks.log_probability

    def begin(self, shape: tuple[int, int]) -> tuple[Any, ...]:
        """Return statements (N, K) before the first position, and what else the rule remembers."""
        return (np.full(shape, STRAIGHT),)

    def step(self, seen: FloatArray, stated: IntArray, *memory: Any) -> tuple[Any, ...]:
        """Return the state after one more position."""
        raise NotImplementedError


class GliderImm(GliderRule):
    """Thresholds on the probabilities of an IMM filter of turn rates: to a turn, and to straight
    flight.
    """

    name = "imm"
    title = "IMM"
    numbers = ("enter", "leave")
    usual = (0.95, 0.9)
    grid = tuple(
        product(
            (0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99),
            (0.5, 0.7, 0.8, 0.9, 0.95, 0.98),
        )
    )
    models = MODELS

    def step(self, seen: FloatArray, stated: IntArray, *memory: Any) -> tuple[Any, ...]:
        """See `GliderRule.step`."""
        best = seen.argmax(-1)[:, None]
        enter, leave = np.log(self.values)
        threshold = np.where(best == STRAIGHT, leave, enter)
        return (np.where(seen.max(-1)[:, None] >= threshold, best, stated),)


class GliderWind(GliderImm):
    """The same with the wind in the state of each filter: circles drift."""

    name = "imm-wind"
    title = "IMM with wind"
    models = tuple(replace(model, wind=0.01) for model in MODELS)


class GliderClimb(GliderImm):
    """The IMM that also measures the climb rate: gliders circle where the air rises."""

    name = "imm-climb"
    title = "IMM with climb"
    models = tuple(replace(model, climb=0.1, climb_level=0.3) for model in MODELS)


class GliderWindClimb(GliderImm):
    """The IMM with wind and climb rate."""

    name = "imm-wind-climb"
    title = "IMM, wind, climb"
    models = tuple(replace(model, wind=0.01) for model in GliderClimb.models)


class GliderBeam(GliderImm):
    """The thresholds on the semi-Markov posterior, in which a circle lasts at least 15 s."""

    name = "beam"
    title = "beam"
    models = tuple(
        replace(
            model,
            rates=(0.0, 6.0, 12.0, 20.0, -6.0, -12.0, -20.0),
        )
        for model in MODELS[::2]
    )
    histories = TurnHistories(shortest=(0.0, 15.0), branches=30)


class GroundTrackRule(GliderRule):
    """A rule on the turn rate of the ground track between positions."""

    def observe(self, tracks: FlightTracks) -> FloatArray:
        """Return time since the last position [s] and turned angle [rad], (T, B, 2)."""
        return np.stack([tracks.batch.steps, tracks.turned], axis=-1)


class XcsoarRule(GroundTrackRule):
    """The rule of the glide computer XCSoar, by its facts: a turn rate that lasts.

    The turn rate is limited to 50 deg/s and smoothed by a low-pass filter of factor 0.3. When it is
    at least the rate for longer than the time to enter, the glider circles; when it is below for
    longer than the time to leave, it does not.
    """

    name = "xcsoar"
    title = "XCSoar, tuned"
    numbers = ("rate", "enter", "leave")
    usual = (7.0, 10.0, 6.0)
    grid = tuple(
        product(
            (4.0, 5.0, 6.0, 7.0, 8.0, 10.0),
            (4.0, 6.0, 8.0, 10.0, 15.0),
            (0.0, 2.0, 4.0, 6.0, 8.0),
        )
    )
    fastest = np.radians(50.0)
    factor = 0.3

    def begin(self, shape: tuple[int, int]) -> tuple[Any, ...]:
        """See `GliderRule.begin`: smoothed rate (N, 1), time since the rate contradicts (N, K),
        else -1.
        """
        return (*super().begin(shape), np.zeros((shape[0], 1)), np.full(shape, -1.0))

    def step(self, seen: FloatArray, stated: IntArray, *memory: Any) -> tuple[Any, ...]:
        """See `GliderRule.step`."""
        (smooth, waited), (dt, turned) = memory, seen.T[..., None]
        rate = np.clip(
            turned / np.where(dt > 0.0, dt, 1.0),
            -self.fastest,
            self.fastest,
        )
        smooth = np.where(
            dt > 0.0,
            smooth + self.factor * (rate - smooth),
            smooth,
        )
        bound, enter, leave = self.values
        turning = np.abs(smooth) >= np.radians(bound)
        circling = stated != STRAIGHT
        waited = np.where(
            turning == circling,
            -1.0,
            np.where(waited < 0.0, 0.0, waited + dt),
        )
        changes = waited > np.where(circling, leave, enter)
        side = np.where(smooth > 0.0, LEFT, RIGHT)
        stated = np.where(
            turning & (circling | changes),
            side,
            np.where(changes, STRAIGHT, stated),
        )
        return stated, smooth, np.where(changes, -1.0, waited)


class XcsoarDefault(XcsoarRule):
    """XCSoar's rule with its defaults: 4 deg/s, 15 s to enter, 10 s to leave."""

    name = "xcsoar-default"
    title = "XCSoar, default"
    usual = (4.0, 15.0, 10.0)
    grid = (usual,)


class AngleRule(GroundTrackRule):
    """The angle that the ground track has turned, forgotten in time, with hysteresis.

    A glider circles when the angle with the longer memory reaches a threshold, until that with the
    shorter memory falls below another.
    """

    name = "angle"
    title = "angle turned"
    numbers = ("memory", "enter", "leave")
    usual = (16.0, 150.0, 30.0)
    grid = tuple(
        product(
            (8.0, 12.0, 16.0),
            (90.0, 120.0, 150.0, 180.0),
            (20.0, 30.0, 45.0, 60.0),
        )
    )
    # Memory [s].
    shorter = 8.0

    def begin(self, shape: tuple[int, int]) -> tuple[Any, ...]:
        """See `GliderRule.begin`: angles with the longer memory (N, K) and the shorter one (N,
        1) [rad].
        """
        return (*super().begin(shape), np.zeros(shape), np.zeros((shape[0], 1)))

    def step(self, seen: FloatArray, stated: IntArray, *memory: Any) -> tuple[Any, ...]:
        """See `GliderRule.step`."""
        (dt, turned), kept = seen.T[..., None], self.values[0]
        enter, leave = np.radians(self.values[1:])
        angle = memory[0] * np.exp(-dt / kept) + turned
        recent = memory[1] * np.exp(-dt / self.shorter) + turned
        side = np.where(angle > 0.0, LEFT, RIGHT)
        going = np.where(stated == LEFT, recent, -recent) > leave
        stated = np.where((stated != STRAIGHT) & going, stated, STRAIGHT)
        begins = (np.abs(angle) >= enter) & (np.abs(recent) > leave) & (angle * recent > 0.0)
        return np.where(begins, side, stated), angle, recent


RULES: dict[str, type[GliderRule]] = {
    rule.name: rule
    for rule in (
        GliderImm,
        GliderWind,
        GliderClimb,
        GliderWindClimb,
        GliderBeam,
        XcsoarRule,
        XcsoarDefault,
        AngleRule,
    )
}
"""Rules by name; the first is the reference."""
