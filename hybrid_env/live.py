"""The state of a track on a live sensor: the arrays, kernels and rows of the environments
without an object.
"""

import copy
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import FloatArray, IntArray, reject
from hybrid_env.core.kernel import HAS_DECISION
from hybrid_env.core.kernels import BEGIN, LIVE_KERNELS, MEASURE
from hybrid_env.core.records import LANES
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Fused
from hybrid_env.world import World

TRIANGLE = np.triu_indices(4)
SQUARE = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])
"""Where the elements of a covariance, (4, 4), are in its upper triangle row by row, (10,)."""

# Covariance xx, xy, yy over R of a measured position.
UNIT_NOISE = np.array([1.0, 0.0, 1.0])


class OnlineTrack(World):
    """One track that is stepped with measurements from outside, with unknown switches."""

    kernels = LIVE_KERNELS
    # Whether switches are announced by `begin_segment`.
    announced: ClassVar[bool] = False
    # Whose rows it writes.
    environment: ClassVar[str] = "HybridTrackQuickest-v0"
    # With the option `recalculation`: estimates (k, 4) and covariances (k, 4, 4) since the switch
    # by the filter of the mode that was declared last.
    recalculated: tuple[FloatArray, FloatArray] | None = None

    def _bind(self, parameters: NDArray[Any], *arrays: Any) -> None:
        # Any measurement may be missing.
        parameters["irregular"] = True
        super()._bind(parameters, *arrays)
        # Positions have variance R.
        self.blocks["noise"] = UNIT_NOISE[:, None]
        names = ("noise", "rates", "measurement", "estimate", "covariance")
        views: list[FloatArray] = [self.blocks[0][name][:, 0] for name in names]
        self._noise, self._rates, self._measurement, self._estimate, self._triangle = views
        self._values: FloatArray = self.bank.hypotheses[self.options.hypothesis_field][0, :, 0]

    def largest(self) -> dict[str, int]:
        """See `World.largest`: lengths and ticks are those of the sensor."""
        return dict.fromkeys(("active_mode", "stated_mode"), self.options.hypotheses - 1)

    def begin_track(self, estimate: FloatArray, covariance: FloatArray, mode: int) -> None:
        """Begin a track one tick before its first measurement with an estimate, (4,) [x, vx, y, vy]
        [m, m/s], its covariance, (4, 4), and the mode before the first tick; -1 if it is not known.
        """
        self._estimate[:], self._triangle[:] = estimate, covariance[TRIANGLE]
        self._begin(mode)

    def _begin(self, mode: int) -> None:
        """Begin a track with its estimate."""
        self.actions[0] = mode
        self._run(BEGIN)
        self.actions[0] = max(mode, 0)

    def begin_segment(self, ticks: int) -> None:
        """Begin a segment of a number of ticks, before its first measurement."""

    def measure(self, x: float, y: float, fused: Fused | None = None) -> None:
        """Advance by one tick with a position [m]; fused: the same with covariance and rates,
        None is variance R.
        """
        self._measurement[:] = x, y
        if self.options.sensors:
            self._noise[:], self._rates[:] = UNIT_NOISE, np.nan
            if fused is not None and fused.covariance is not None:
                self._noise[:] = np.array(fused.covariance) / self.options.variances[0]
                self._rates[: len(fused.rates)] = fused.rates
        self._advance_tick()

    def skip(self) -> None:
        """Advance by one tick without a measurement: the filters predict; write the observation."""
        self._measurement[:] = np.nan
        self._advance_tick()

    def _advance_tick(self) -> None:
        self._run(MEASURE)

    @property
    def decided(self) -> bool:
        """Whether a mode has been stated, or since the switch declared, if switches are
        announced.
        """
        return bool(self.blocks["time"].item(0, 0) > 0)

    @property
    def asks(self) -> bool:
        """Whether the present observation is for a decider."""
        return True

    @property
    def mode(self) -> int:
        """The last decided mode."""
        return self.actions.item(0)

    def decide(self, action: int) -> None:
        """Apply an action of the action space, after a measurement."""
        self.actions[0] = action

    @property
    def uncertain_ticks(self) -> int:
        """Number of ticks, with the next one, for which the mode may have been a wrong one."""
        return 1

    @property
    def ticks_left(self) -> int:
        """Number of ticks to the end of the segment, with the next one."""
        return int(self.options.longest_segment)

    def probabilities(self) -> FloatArray:
        """Return the probabilities of the modes, (M,)."""
        return np.asarray(np.exp(self._values))

    def estimate(self) -> FloatArray:
        """Return the estimate [x, vx, y, vy], (4,) [m, m/s]."""
        return self._estimate.copy()

    def covariance(self) -> FloatArray:
        """Return the covariance of the estimate, (4, 4)."""
        return self._triangle[SQUARE]


class MeasuredTracks(OnlineTrack):
    """N tracks with measurements from outside, with unknown switches, as the world of a vector
    environment.
    """

    def write(self, name: str, values: NDArray[Any]) -> None:
        """Write a field of the blocks, (N,) or (N, k)."""
        blocks, lanes = np.divmod(np.arange(len(values)), LANES)
        self.blocks[name][blocks, ..., lanes] = values

    def begin_all(self, estimates: FloatArray, covariance: FloatArray, modes: IntArray) -> None:
        """Begin all tracks one tick before their first measurements; modes: (N,), -1 where it is
        not known.
        """
        self.write("estimate", estimates)
        self.write("covariance", np.tile(covariance[TRIANGLE], (len(estimates), 1)))
        self.actions[:] = modes
        self._run(BEGIN)

    def measure_all(self, measurements: FloatArray) -> None:
        """Advance by one tick with measurements (N, 2) [m], NaN where there is none, after
        `actions`.
        """
        self.write("measurement", measurements)
        self._advance_tick()


class AnnouncedTrack(OnlineTrack):
    """A track with known switch moments. The probabilities are posteriors with equal priors at the
    switch, and do not change after a decision unless all filters run on (`follow="bank"`,
    `refine_radius`). The published bank with one measurement variance has one covariance for both
    axes: it starts from that of x.
    """

    announced = True
    environment = "HybridTrack-v0"

    def _begin(self, mode: int) -> None:
        """See `OnlineTrack._begin`; the first segment still has to begin."""
        self.blocks["segment"][0, 0] = -1
        # Straight: Golubkov 2018, algorithm 1, line 2.
        self.blocks["active_mode"][0, 0] = max(mode, 0)
        self.decision_flags[HAS_DECISION, 0] = False
        self.actions[0] = 0
        self._values[:] = 0.0

    def begin_segment(self, ticks: int) -> None:
        """See `OnlineTrack.begin_segment`. A last segment without a decision is decided as in
        the options.
        """
        self.blocks["length"][0, 0] = ticks
        self._run(BEGIN)
        if self.options.recalculation:
            self._at_switch = {name: array.copy() for name, array in self.arrays().items()}
            # What was measured since the switch.
            self._since: list[list[FloatArray]] = []

    def _advance_tick(self) -> None:
        self._run(MEASURE)
        if self.options.recalculation and self.asks:
            self._since.append(
                [one.copy() for one in (self._measurement, self._noise, self._rates)]
            )

    @property
    def decided(self) -> bool:
        """See `OnlineTrack.decided`."""
        return bool(self.decision_flags.item(HAS_DECISION, 0))

    @property
    def asks(self) -> bool:
        """See `OnlineTrack.asks`: only as long as the segment has no decision."""
        return not self.decided

    @property
    def mode(self) -> int:
        """See `OnlineTrack.mode`."""
        return int(self.blocks["active_mode"].item(0, 0))

    def decide(self, action: int) -> None:
        """Wait (action 0) or declare the mode of an action; see `WorldOptions.actions`."""
        if action:
            self.actions[0] = action
            self._run(MEASURE)
            self.actions[0] = 0
            if self.options.recalculation:
                self.recalculated = self._recalculate()

    def _recalculate(self) -> tuple[FloatArray, FloatArray]:
        """Go back to the switch, and forward again with the decided mode. Tsyganov 2019, lines
        16 to 21.
        """
        mode, row, ticks = self.mode, self.observations.copy(), len(self._since)
        estimates = np.empty((ticks, 4))
        covariances = np.empty((ticks, 4, 4))
        self.restore(self._at_switch)
        self.blocks["active_mode"][0, 0] = mode
        for k, measured in enumerate(self._since):
            self._measurement[:], self._noise[:], self._rates[:] = measured
            self._run(MEASURE)
            estimates[k], covariances[k] = self.estimate(), self.covariance()
        self.decision_flags[HAS_DECISION, 0] = True
        self.observations[:] = row
        return estimates, covariances

    def __getstate__(self) -> dict[str, Any]:
        kept = {name: vars(self)[name] for name in ("_at_switch", "_since") if name in vars(self)}
        return super().__getstate__() | {"kept": kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        kept = copy.deepcopy(state.pop("kept"))
        super().__setstate__(state)
        vars(self).update(kept)

    @property
    def uncertain_ticks(self) -> int:
        """See `OnlineTrack.uncertain_ticks`: those of this segment, and of one that led to its
        anchor.
        """
        return int(self.blocks["tick"].item(0, 0)) + 1 + int(self.options.longest_segment)

    @property
    def ticks_left(self) -> int:
        """See `OnlineTrack.ticks_left`."""
        return max(int(self.blocks["length"].item(0, 0) - self.blocks["tick"].item(0, 0)), 1)

    def probabilities(self) -> FloatArray:
        """Return the posteriors of the modes with equal priors at the switch, (M,)."""
        # Maximum and sum of a list: NumPy's take longer for a few numbers.
        weights: FloatArray = np.exp(self._values - max(self._values.tolist()))
        weights /= sum(weights.tolist())
        return weights


def live_track(options: Any) -> OnlineTrack:
    """Return the track of a live sensor for the options of an environment; others raise
    `ArgumentError`.
    """
    if isinstance(options, QuickestOptions):
        return OnlineTrack(options)
    if not isinstance(options, WorldOptions):
        raise reject("options", options, "WorldOptions or QuickestOptions")
    if options.bank == "oracle":
        raise reject(
            "bank",
            options.bank,
            "'published' or 'anchor_aware': the true state is unknown",
        )
    if options.observation != "bank":
        raise reject(
            "observation",
            options.observation,
            "'bank': deciders on a live sensor read its rows",
        )
    return AnnouncedTrack(options)
