"""A decider on a live sensor: a measurement at a time gives mode, probabilities, estimate and
covariance.
"""

import operator
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike

from baselines.rules.decider import Decider
from baselines.rules.external import CheckedDecider, as_decider, name_of
from baselines.rules.measurements import run_compiled
from baselines.rules.start import FirstMeasurements, gate_distance, unit_noise
from hybrid_env.checks import (
    LARGEST_NUMBER,
    FloatArray,
    Moments,
    OwnState,
    Positive,
    check_array,
    check_covariance,
    check_integer,
    check_number,
    checked,
    reject,
)
from hybrid_env.limits import Ticks
from hybrid_env.live import LiveTracks
from hybrid_env.options import ModelOptions, WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Fused, fuse
from hybrid_env.world import World


class OnlineEstimate(NamedTuple):
    """What is known after a measurement.

    Attributes:
        mode: the stated or last declared mode: 0 straight, then the left and the right turns in the
            order of the radii.
        decided: False while the first measurements are collected; then with unknown switches as
            long as the mode is only assumed: until the evidence for it reaches the threshold of the
            decider, the statement changes, or from the start if `begin` is told the mode or the
            decider has no such threshold. With announced switches False from a switch to the
            declaration of its mode; then `mode` is the one before.
        probabilities: (M,) of the modes.
        estimate: (4,) [x, vx, y, vy] [m, m/s]; NaN before the first measurement.
        covariance: (4, 4) of the estimate; variances that nothing is known of are infinite.
        agrees: False if no motion of the track explains the measurement, see `OnlineTracker`; it is
            not used then.
        recalculated: with the option `recalculation`, at a declaration: estimates (k, 4) and
            covariances (k, 4, 4) of the k ticks since the switch by the filter of the declared
            mode; otherwise None.
    """

    mode: int
    decided: bool
    probabilities: FloatArray
    estimate: FloatArray
    covariance: FloatArray
    agrees: bool = True
    recalculated: Moments | None = None


class OnlineTracker(OwnState):
    """A decider behind the bank of its environment, on measurements that come one at a time.

    The same measurements, first estimate and switches give the same rows, modes and estimates as in
    the environment, bit for bit, as long as the gate refuses none.

    With `QuickestOptions` the switch moments are unknown: the decider states a mode at every
    measurement. Probabilities, estimate and covariance are those of the bank, the interacting
    multiple model.

    With `WorldOptions` the caller announces a switch by `switch`. Until the decider declares the
    mode of the segment, the estimate is that of the filter of the last decided mode. From then on
    the filter of the declared mode follows the object to the next switch and gives its anchor; the
    decider is not asked and the probabilities do not change. A segment that ends undecided is
    decided as in the options. With `follow="bank"` the estimate is merged over all filters; with
    `refine_radius` mode and estimate are those of the likeliest hypothesis of the declared type.

    Measurements come at multiples of the tick `tau` of the options. After a jump of k ticks the
    bank predicts k - 1 ticks without a measurement, in which only deciders with filters of their
    own, whose `every_tick` is True, are asked.

    A measurement far from every predicted position is not used (`gate`): it counts as missing, and
    `OnlineEstimate.agrees` is False. After `patience` of them, without two used ones in a row
    between them, the track begins again with the next measurements. With announced switches the
    gate is wider, since the mode may be wrong or unknown. A new object begins a track, see `begin`.
    Copies and pickled objects go on independently.

    Args:
        options: of the environment whose model the bank uses. Those of its simulated object, such
            as speed, noise and scheme, are used only by deciders, and `initial_error` if `begin` is
            given an estimate without a covariance.
        decider: reads rows of that environment.
        tolerance: of the time between two measurements, as a fraction of a tick, above 0 and below
            0.5.
        gate: distance from the nearest predicted position above which a measurement is not used, in
            standard deviations; None uses all.

    >>> from baselines import ThresholdDecider
    >>> tracker = OnlineTracker(QuickestOptions(measurement_variance=0.01), ThresholdDecider(0.6))
    >>> for k in range(30):
    ...     now = tracker.update((0.2 * k, 0.0), time=0.1 * k)
    >>> now.mode, now.estimate.shape, now.covariance.shape
    (0, (4,), (4, 4))
    """

    # Measurements outside of the gate, after which the track begins again: the object is elsewhere.
    patience = 5

    def __init__(
        self,
        options: WorldOptions | QuickestOptions,
        decider: Decider,
        tolerance: float = 0.1,
        gate: float | None = 10.0,
    ):
        self.track = LiveTracks(options)
        self.options = options
        self.decider = as_decider(decider)
        self.tolerance = checked("tolerance", tolerance, Annotated[float, Interval(gt=0.0, lt=0.5)])
        self.gate = checked("gate", gate, Positive | None)
        self._model = np.array(options.radii), options.tau
        self._noise = unit_noise(options)
        self._ask = CheckedDecider(self.decider, self.options.action_count)
        self._longest = options.longest_segment
        self._try_decider()
        self.begin()

    def begin(
        self,
        estimate: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        mode: int | None = None,
    ) -> None:
        """Begin a track, and forget the last one.

        Without an estimate a straight line is fitted to the first measurements, 3 with unknown and
        up to 10 with announced switches. The bank begins after the last of them; until then the
        estimate is that of the line, and all modes are equally probable.

        Args:
            estimate: (4,) [x, vx, y, vy] one tick before the first measurement [m, m/s]; None
                collects.
            covariance: (4, 4) of the estimate; None is that of the options, see `initial_error`.
            mode: before the first tick; None if it is not known.
        """
        known = -1 if mode is None else check_integer("mode", mode, 0, self.options.hypotheses - 1)
        if estimate is None and covariance is not None:
            raise reject("covariance", covariance, "None without an estimate")
        self._mode = known
        self._assumed = mode is None and not self.track.announced
        self._collected: FirstMeasurements | None = None
        if estimate is not None:
            if covariance is None:
                covariance = np.diag(self.options.start_variances)
            matrix = check_array("covariance", covariance, (4, 4))
            matrix = check_covariance("covariance", matrix, definite=False)
            self.track.begin(check_array("estimate", estimate, (4,)), matrix, known)
        else:
            # A bank that runs on knows how inaccurate its estimate is, and corrects it. For one
            # that starts at a switch the centre of its turns follows from the estimate.
            most = 10 if self.track.announced else 3
            self._collected = FirstMeasurements(self.options, most)
        self._last_time: float | None = None
        self._refused = self._agreed = 0
        self._measured = False
        # Of the segment that the next measurement begins.
        self._ticks: int | None = self._longest
        self._decider_state: Any = None
        self._episode_start = np.ones(1, bool)

    def switch(self, ticks: int | None = None) -> None:
        """Announce that the next update is the first one after a switch, also `update(None)`.

        Some learned deciders read the number of ticks until the next switch; None assumes the
        longest segment.
        """
        if not self.track.announced:
            raise reject("switch", "an announced switch", "none with QuickestOptions")
        self._ticks = self._longest if ticks is None else checked("ticks", ticks, Ticks)

    def update(
        self,
        measurement: ArrayLike | dict[int, ArrayLike] | Fused | None,
        time: float | None = None,
    ) -> OnlineEstimate:
        """Process the measurement of a tick, and return what is known after it.

        Args:
            measurement: (2,) position of variance R [m]; or what the sensors of the options
                measured, as a mapping from their place in the list: (x, y), (range, bearing) or
                (range, bearing, range rate) [m, rad, m/s]; None if there is none in this tick.
            time: of the measurement [s]; None is one tick after the last one.

        Raises:
            ArgumentError: the measurement is not finite, the time does not fit the ticks, or a
                measurement is missing and the decider cannot do without it.
        """
        point = _checked(measurement, self.options)
        moment = None if time is None else check_number("time", time)
        missing = (self._missing_ticks(moment) + (point is None)) * self._measured
        if moment is not None:
            self._last_time = moment
        elif self._last_time is not None:
            self._last_time += self.options.tau
        if self._collected is not None:
            if not self._begins_after(self._collected, point, missing):
                equal = np.full(self.options.hypotheses, 1.0 / self.options.hypotheses)
                line = self._collected.estimate.copy(), self._collected.covariance.copy()
                return OnlineEstimate(max(self._mode, 0), False, equal, *line)
            missing = 0
        track = self.track
        track.recalculated = None
        for k in range(missing):
            if point is None and k == missing - 1:
                # The tick of `update(None)` itself.
                self._begin_announced()
            self._skip()
        agrees = True
        if point is not None:
            self._measured = True
            self._begin_announced()
            agrees = self._agrees(point)
            self._agreed = (self._agreed + 1) * agrees
            # A single one may agree only because its prediction is so uncertain.
            if agrees:
                self._refused *= self._agreed < 2
                track.measure(point.position, point)
                if track.asks:
                    track.decide(self._ask_decider())
            else:
                self._refused += 1
                self._skip()
        known = OnlineEstimate(
            track.mode,
            track.decided and not self._assumed,
            track.probabilities(),
            track.estimate(),
            track.covariance(),
            agrees,
            track.recalculated,
        )
        # The track begins anew; with announced switches in the same segment.
        if self._refused >= self.patience:
            kept = self._last_time, track.ticks_left, self._assumed
            self.begin(mode=track.mode)
            self._last_time, self._ticks, self._assumed = kept
            assert self._collected is not None
            # Until the first of them.
            self._collected.estimate = track.estimate()
        return known

    @property
    def world(self) -> World:
        """The arrays of the bank, with the row that the decider has read."""
        return self.track.world

    def _skip(self) -> None:
        """Advance by one tick without a measurement."""
        self.track.measure((np.nan, np.nan))
        if self.decider.every_tick and self.track.asks:
            self.track.decide(self._ask_decider())

    def _agrees(self, point: Fused) -> bool:
        """Return whether a motion of the track explains a measurement."""
        if self.gate is None:
            return True
        noise = self._noise if point.covariance is None else np.array(point.covariance)
        seen = np.array(point.position), self.track.estimate(), self.track.covariance()
        ticks = self.track.uncertain_ticks
        return run_compiled(gate_distance, *seen, *self._model, noise, ticks) <= self.gate

    def _begin_announced(self) -> None:
        """Begin the segment that `switch` has announced, if there is one."""
        if self._ticks is not None:
            self.track.begin_segment(self._ticks)
            self._ticks = None

    def _missing_ticks(self, time: float | None) -> int:
        """Return the number of ticks between the last measurement and a time, without both."""
        if time is None or self._last_time is None:
            return 0
        # Between two measurements.
        longest_gap = 1000
        tau = self.options.tau
        passed = (time - self._last_time) / tau
        # It may be infinite.
        ticks = round(min(max(passed, 0.0), 2.0 * longest_gap))
        if not (1 <= ticks <= longest_gap and abs(passed - ticks) <= self.tolerance):
            allowed = (
                f"{self._last_time:.9g} and 1 to {longest_gap} ticks of {tau:g} s more, within"
                f" {self.tolerance:g} of a tick; begin() begins a new track"
            )
            raise reject("time", time, allowed)
        return ticks - 1

    def _begins_after(
        self,
        collected: FirstMeasurements,
        point: Fused | None,
        missing: int,
    ) -> bool:
        """Collect a measurement after missing ones; return whether the bank has begun before it
        instead.
        """
        for _ in range(missing):
            collected.skip()
        if point is None:
            return False
        if collected.complete:
            self.track.begin(collected.estimate, collected.covariance, self._mode)
            self._collected = None
            return True
        collected.add(*point.position, point.covariance)
        self._measured = True
        if self._ticks is not None:
            self._ticks = max(self._ticks - 1, 1)
        return False

    def _ask_decider(self) -> int:
        """Return the action of the decider on the present row."""
        seen = self.decider.observe(self.world)
        first = self._episode_start
        evidence = None
        levels = self.decider.panel().thresholds.values() if self._assumed else ()
        if levels:
            evidence = self.decider.evidence(seen, self._decider_state, first)[0]
        actions, self._decider_state = self._ask(seen, self._decider_state, first)
        action = operator.index(actions[0])
        if self._assumed:
            changed = not first[0] and action != self.track.mode
            self._assumed = not changed and evidence is not None and evidence[action] < min(levels)
        self._episode_start = np.zeros(1, bool)
        return action

    def _try_decider(self) -> None:
        """Ask the decider about a row, so that its code is compiled and a wrong decider is found
        at once.
        """
        options = self.options
        track = self.track
        self.begin(np.array([0.0, options.speed, 0.0, 0.0]))
        track.begin_segment(self._longest)
        track.measure((options.speed * options.tau, 0.0))
        try:
            self._ask_decider()
        except Exception as error:
            environment = "HybridTrack-v0" if track.announced else "HybridTrackQuickest-v0"
            allowed = f"one for rows of {environment} with {options.hypotheses} hypotheses: {error}"
            raise reject("decider", name_of(self.decider), allowed) from error


def _checked(measurement: Any, options: ModelOptions) -> Fused | None:
    """Return a checked measurement; two floats are checked without an array, which would be
    slow.
    """
    if measurement is None or isinstance(measurement, Fused):
        return measurement
    if isinstance(measurement, dict):
        return fuse(options.sensors, measurement)
    x, y = measurement if isinstance(measurement, tuple) and len(measurement) == 2 else (None, None)
    # A sum that is not too large is not NaN.
    if not (isinstance(x, float) and isinstance(y, float) and abs(x) + abs(y) <= LARGEST_NUMBER):
        x, y = check_array("measurement", measurement, (2,)).tolist()
    return Fused((x, y))
