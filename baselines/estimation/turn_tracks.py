"""The bank of an environment on a live sensor, with speed and radius of the turns."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation.forecast import forecast_turns
from baselines.estimation.turns import (
    SPREAD,
    TurnEstimate,
    TurnFilter,
    begin_standing,
    begin_turn,
    speed_of,
)
from hybrid_env.checks import AnyArray, FloatArray, Moments
from hybrid_env.live import LiveTracks
from hybrid_env.modes import Stopping
from hybrid_env.sensors import Fused

# Types of modes: of straight motion, and of all that is none of the next ones, 0, of left turns 1,
# of right turns 2, and of stops.
STANDING = 3


class TurnTracks(LiveTracks):
    """`LiveTracks` of one track that also estimate speed and radius of the object, which may turn
    with another radius than those of the bank.

    Filters of straight motion, of a left and of a right turn, and of a standing object begin at
    every announced switch, where the filter of the decided type ends. With unknown switches the
    filter of a turn begins when a turn of its type is stated. The curvature is first distributed as
    those of the bank, each with a relative deviation of .5.

    Args:
        options: of the environment.
    """

    def __init__(self, options: Any):
        super().__init__(options)
        curvatures = 1.0 / np.array(options.radii or [math.inf])
        self._curvature = float(curvatures.mean())
        squares = curvatures.var() + SPREAD**2 * np.mean(curvatures**2)
        self._deviation = math.sqrt(float(squares))
        x, y = np.broadcast_to(options.variances, 2).tolist()
        self._unit_noise = np.array([x, 0.0, y])
        self._filter = TurnFilter(options.tau, options.process_variance, STANDING + 1)
        self._types = [
            STANDING
            if mode.type == "stop" and not isinstance(mode, Stopping)
            else int(np.sign(mode.signed_radius)) % 3
            for mode in options.all_modes
        ]
        # The decided type when the filters began; -1 if they have not.
        self._begun = np.full(1, -1)

    def arrays(self) -> dict[str, AnyArray]:
        """Return the arrays that hold the state, by name. They are views, not copies."""
        turns = self._filter
        mine = {
            "turn.states": turns.states,
            "turn.covariances": turns.covariances,
            "turn.turns": turns.turns,
            "turn.begun": self._begun,
        }
        return self.world.arrays() | mine

    def restore(self, arrays: Mapping[str, AnyArray]) -> None:
        """Copy a state from `arrays()` of such tracks with the same options."""
        self.world.restore(arrays)
        for name, array in self.arrays().items():
            array[...] = arrays[name]

    @property
    def decided_type(self) -> int:
        """Type of the last decided mode: 0 straight, 1 left, 2 right, 3 standing."""
        return self._types[self.mode]

    def begin(self, estimates: FloatArray, covariance: FloatArray, modes: ArrayLike = -1) -> None:
        """See `LiveTracks.begin`."""
        super().begin(estimates, covariance, modes)
        self._begun[0] = -1

    def begin_segment(self, ticks: int) -> None:
        """See `LiveTracks.begin_segment`."""
        super().begin_segment(ticks)
        if self.announced:
            begun = self._begin_types()
            self._begun[0] = self.decided_type
            for each, moments in enumerate(begun):
                self._filter.begin(each, *moments)

    def measure(self, position: ArrayLike, fused: Fused | None = None) -> None:
        """See `LiveTracks.measure`."""
        super().measure(position, fused)
        if self._runs:
            only = self.decided_type if self.decided else None
            self._filter.step(self._view("measurement"), self._noise(), only)

    def decide(self, action: int) -> None:
        """See `LiveTracks.decide`."""
        super().decide(action)
        if self.announced:
            return
        stated = self.decided_type
        if stated != self._begun.item():
            self._begun[0] = stated
            self._filter.begin(stated, *self._begin_from(*self._rough())[stated])

    def _noise(self) -> FloatArray:
        """Return the covariance xx, xy, yy of the measured position [m^2]."""
        if not self.options.sensors:
            return self._unit_noise
        noise: FloatArray = self._view("noise") * self._unit_noise[0]
        return noise

    @property
    def _runs(self) -> bool:
        """Whether the filter of the decided type runs. With unknown switches the merged estimate is
        that of straight motion.
        """
        begun = self._begun.item()
        return begun > 0 or (self.announced and begun == 0)

    def _begin_types(self) -> list[Moments]:
        """Return states and covariances of the types of modes that begin now, at the estimate of
        the filter of the decided type if it runs, or at that of the bank.
        """
        if not self._runs:
            return self._begin_from(self.estimate(), self.covariance())
        state, covariance = self._filter.moments(self.decided_type)
        # [x, vx, y, vy]
        order = [0, 2, 1, 3]
        return self._begin_from(state[order], covariance[np.ix_(order, order)])

    def _begin_from(self, estimate: FloatArray, covariance: FloatArray) -> list[Moments]:
        """Return the same, at an estimate (4,) with its covariance (4, 4)."""
        curvature, deviation = self._curvature, self._deviation
        laws = (0.0, 0.0), (curvature, deviation), (-curvature, deviation)
        turns = [begin_turn(estimate, covariance, *law) for law in laws]
        return [*turns, begin_standing(estimate, covariance)]

    def _rough(self) -> Moments:
        """Return the merged estimate at the measured position, if there is one, with the variance
        of a measurement and a relative deviation of .5 of the velocity. The merged estimate is
        worse than it states if the object turns with another radius than those of the bank.
        """
        estimate = self.estimate()
        measured = self._view("measurement")
        if not np.isnan(measured[0]):
            estimate[::2] = measured
        xx, xy, yy = self._noise()
        velocity = SPREAD**2 * float(estimate[1::2] @ estimate[1::2])
        covariance = np.diag([xx, velocity, yy, velocity])
        covariance[0, 2] = covariance[2, 0] = xy
        return estimate, covariance

    def turn(self) -> TurnEstimate:
        """Return speed and radius of the decided mode, and their deviations."""
        if self.decided and self.decided_type == STANDING:
            return TurnEstimate(0.0, 0.0, math.nan, math.nan)
        if self.decided and self._runs:
            return self._filter.turn(self.decided_type)
        _, vx, _, vy = self._view("estimate").tolist()
        # Of the upper triangle, the entries of vx, of both velocities, and of vy are needed.
        _, _, _, _, xx, _, xy, _, _, yy = self._view("covariance").tolist()
        speed, deviation = speed_of(vx, vy, xx, xy, yy)
        return TurnEstimate(speed, deviation, math.inf if self.decided else math.nan, math.nan)

    def forecast(self, seconds: ArrayLike, stated: bool = False) -> Moments:
        """Return means (k, 2) and covariances (k, 2, 2) of the position after k times [s], as long
        as the mode does not change; see `forecast.forecast`. The radius is that of `turn`.

        stated: only of the stated mode, without the doubt about it.
        """
        weights = np.asarray(np.bincount(self._types, self.probabilities(), STANDING + 1), float)
        if stated:
            weights = np.eye(STANDING + 1)[self.decided_type]
        if self._runs and not self.decided:
            turns = [self._filter.moments(each) for each in range(STANDING + 1)]
        else:
            turns = self._begin_types()
            if self._runs:
                turns[self.decided_type] = self._filter.moments(self.decided_type)
        return forecast_turns(weights, turns, self.options, seconds)
