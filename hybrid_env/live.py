"""Tracks on a live sensor: the arrays, kernels and rows of the environments without an object."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_env.checks import AnyArray, FloatArray, OwnState, reject
from hybrid_env.core.announced import HAS_DECISION
from hybrid_env.core.kernels import BEGIN, MEASURE
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Fused
from hybrid_env.world import World

TRIANGLE = np.triu_indices(4)
SQUARE = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])
"""Where the elements of a covariance, (4, 4), are in its upper triangle row by row, (10,)."""


class LiveTracks(OwnState):
    """The bank of an environment on measurements from outside, and the rows that it writes: N
    tracks with unknown switches, or one with switches that `begin_segment` announces. All but
    `begin` and `measure_all` is about the first track.

    With announced switches the probabilities are posteriors with equal priors at the switch, and do
    not change after a decision unless all filters run on (`follow="bank"`). The
    published bank with one measurement variance has one covariance for both axes: it starts from
    that of x.

    Args:
        options: of the environment.
        tracks: N.

    Attributes:
        world: the arrays, whose `observations` deciders read.
        announced: whether switches are announced.
    """

    def __init__(self, options: Any, tracks: int = 1):
        self.announced = isinstance(options, WorldOptions)
        self.options: Any = options
        if not isinstance(options, (WorldOptions, QuickestOptions)):
            raise reject("options", options, "WorldOptions or QuickestOptions")
        if isinstance(options, WorldOptions) and options.bank == "oracle":
            raise reject("bank", options.bank, "a bank that need not be told the true state")
        if isinstance(options, WorldOptions) and options.observation != "bank":
            raise reject("observation", options.observation, "'bank', whose rows deciders read")
        self.world = World(options, tracks, live=True)
        # Positions have variance R.
        self.world.blocks["noise"][:, ::2] = 1.0

    def _view(self, name: str) -> AnyArray:
        """Return a view of a field of the first track, (k,)."""
        view: AnyArray = self.world.blocks[name][0, :, 0]
        return view

    def begin(self, estimates: FloatArray, covariance: FloatArray, modes: ArrayLike = -1) -> None:
        """Begin all tracks one tick before their first measurements with estimates, (N, 4) or (4,)
        [x, vx, y, vy] [m, m/s], their covariance, (4, 4), and the modes before the first tick, -1
        where it is not known. With announced switches the first segment still has to begin.
        """
        world = self.world
        world.write("estimate", np.atleast_2d(estimates))
        world.write("covariance", np.tile(covariance[TRIANGLE], (world.actions.size, 1)))
        if self.announced:
            world.blocks["segment"][0, 0] = -1
            # Straight: Golubkov 2018, algorithm 1, line 2.
            world.blocks["active_mode"][0, 0] = np.maximum(modes, 0)
            world.decision_flags[HAS_DECISION, 0] = False
            world.actions[0] = 0
            world.bank.hypotheses[self.options.hypothesis_field][0, :, 0] = 0.0
        else:
            world.actions[:] = modes
            world.run(BEGIN)
            np.maximum(world.actions, 0, out=world.actions)

    def begin_segment(self, ticks: int) -> None:
        """Begin an announced segment of a number of ticks, before its first measurement. A last
        segment without a decision is decided as in the options.
        """
        if not self.announced:
            return
        self.world.blocks["length"][0, 0] = ticks
        self.world.run(BEGIN)

    def measure(self, position: ArrayLike, fused: Fused | None = None) -> None:
        """Advance by one tick with a position (2,) [m], NaN without one, and write the observation;
        fused: the same with the covariance and rates of the sensors of the options.
        """
        measurement, noise, rates = map(self._view, ("measurement", "noise", "rates"))
        measurement[:] = position
        if self.options.sensors and fused is not None:
            noise[:] = (1.0, 0.0, 1.0)
            rates[:] = np.nan
            rates[: len(fused.rates)] = fused.rates
            if fused.covariance is not None:
                noise[:] = np.array(fused.covariance) / self.options.variances[0]
        self.world.run(MEASURE)

    def measure_all(self, measurements: FloatArray) -> None:
        """Advance by one tick with measurements (N, 2) [m], NaN where there is none, after
        statements in `world.actions`.
        """
        self.world.write("measurement", measurements)
        self.world.run(MEASURE)

    def decide(self, action: int) -> None:
        """Apply an action of the action space, after a measurement: a statement, or with announced
        switches to wait (0) or to declare a mode, see `WorldOptions.actions`.
        """
        self.world.actions[0] = action
        if self.announced and action:
            self.world.run(MEASURE)
            self.world.actions[0] = 0

    @property
    def decided(self) -> bool:
        """Whether a mode has been stated, or since the switch declared, if switches are
        announced.
        """
        if self.announced:
            return self.world.decision_flags.item(HAS_DECISION, 0)
        return self.world.blocks["time"].item(0, 0) > 0

    @property
    def asks(self) -> bool:
        """Whether a decider is needed: with announced switches as long as the segment has no
        decision.
        """
        return not (self.announced and self.decided)

    @property
    def counts(self) -> bool:
        """Whether an action counts at the present tick, see the option `decide_every`."""
        blocks, every = self.world.blocks, self.options.decide_every
        if not self.announced:
            return bool((blocks["time"].item(0, 0) - 1) % every == 0)
        tick = blocks["tick"].item(0, 0)
        return bool(tick % every == 0 or tick == blocks["length"].item(0, 0))

    @property
    def mode(self) -> int:
        """The last decided mode."""
        if self.announced:
            return self.world.blocks["active_mode"].item(0, 0)
        return self.world.actions.item(0)

    @property
    def uncertain_ticks(self) -> int:
        """Number of ticks, with the next one, for which the mode may have been a wrong one: with
        announced switches those of this segment, and of one that led to its anchor.
        """
        if not self.announced:
            return 1
        return self.world.blocks["tick"].item(0, 0) + 1 + self.options.longest_segment

    @property
    def ticks_left(self) -> int:
        """Number of ticks to the end of the segment, with the next one."""
        if not self.announced:
            return self.options.longest_segment
        blocks = self.world.blocks
        return max(blocks["length"].item(0, 0) - blocks["tick"].item(0, 0), 1)

    def probabilities(self) -> FloatArray:
        """Return the probabilities of the modes, (M,)."""
        values = self.world.bank.hypotheses[self.options.hypothesis_field][0, :, 0]
        if not self.announced:
            return np.exp(values)
        weights = np.exp(values - values.max())
        return weights / weights.sum()

    def estimate(self) -> FloatArray:
        """Return the estimate [x, vx, y, vy], (4,) [m, m/s]."""
        return self._view("estimate").copy()

    def covariance(self) -> FloatArray:
        """Return the covariance of the estimate, (4, 4)."""
        return self._view("covariance")[SQUARE]
