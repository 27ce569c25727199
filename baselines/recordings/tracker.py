"""A decider on a live sensor: a measurement at a time gives mode, probabilities, estimate and
covariance.
"""

import copy
import math
import operator
import warnings
from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation.forecast import check_times
from baselines.estimation.turn_tracks import TurnTracks
from baselines.estimation.turns import TurnEstimate, speed_of
from baselines.recordings.clock import TickClock, number_of
from baselines.recordings.online_estimate import HeightEstimate, OnlineEstimate, Status
from baselines.recordings.sensor_units import SensorUnits
from baselines.recordings.start import FirstMeasurements, gate_distance, unit_noise
from baselines.recordings.track_modes import in_units, names_of_modes
from baselines.recordings.track_state import Snapshot, TrackState
from baselines.rules.decider import Decider
from baselines.rules.external import as_decider, ask, name_of
from baselines.rules.fixed_lag import LARGEST_LAG, FixedLagSmoother
from baselines.rules.hindsight import PROCESS_SHARE
from baselines.rules.threshold import ThresholdDecider
from hybrid_env.checks import (
    FloatArray,
    Moments,
    OwnState,
    Positive,
    as_array,
    check_array,
    check_covariance,
    check_integer,
    checked,
    reject,
)
from hybrid_env.compiled import run_compiled
from hybrid_env.limits import Ticks
from hybrid_env.modes import LinearMode, Straight
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Fused
from hybrid_env.world import World

if TYPE_CHECKING:
    from baselines.recordings.projection import Projection


class OnlineTracker(OwnState):
    """A decider behind the bank of its environment, on measurements that come one at a time.

    The same measurements at the ticks `tau` of the options, first estimate and switches give the
    same rows, modes and estimates as in the environment, bit for bit, as long as the gate refuses
    none.

    With `QuickestOptions` the switch moments are unknown: the decider states a mode at every
    measurement. Probabilities, estimate and covariance are those of the bank, the interacting
    multiple model.

    With `WorldOptions` the caller announces a switch by `switch`. Until the decider declares the
    mode of the segment, the estimate is that of the filter of the last decided mode. From then on
    the filter of the declared mode follows the object to the next switch and gives its anchor; the
    decider is not asked and the probabilities do not change. A segment that ends undecided is
    decided as in the options. With `follow="bank"` the estimate is merged over all filters.

    Times may be any. A measurement belongs to the tick that is nearest, see `TickClock`, and is
    moved to it along the estimated velocity. In ticks without a measurement the bank predicts, and
    only deciders with filters of their own, whose `every_tick` is True, are asked. With unknown
    switches, late measurements are used as if they had come in time. After a gap longer than `gap`
    the track begins again, and after `patience` measurements in a row at earlier times if the clock
    was set back, so that they go on where the object was, or if they begin a recording anew; else
    after `history`. What a sensor has kept and sends late is dropped.

    A measurement far from every predicted position is not used (`gate`). After `patience` of them,
    without two used ones in a row between them, the track begins again with the next measurements.
    With announced switches the gate is wider, since the mode may be wrong or unknown. A new object
    begins a track, see `begin`. Copies and pickled objects go on independently.

    A third coordinate is a height, which the same rules follow apart from the plane with the
    `height_variance` and the `climb_variance` of the options: level, or with any rate. See
    `OnlineEstimate.height`.

    Attributes:
        mode_names: names of the modes that `OnlineEstimate` counts, see `names_of_modes`: a stop
            and a mode in which the object slows down to one are the same.

    Args:
        options: of the environment whose model the bank uses. Those of its simulated object, such
            as speed, noise and scheme, are used only by deciders, and `initial_error` if `begin` is
            given an estimate without a covariance.
        decider: reads rows of that environment.
        gate: distance from the nearest predicted position above which a measurement is not used, in
            standard deviations; None uses all.
        gap: longest time between two measurements of a track, at most 10,000 ticks; None is 1,000
            ticks.
        projection: measurements are latitudes and longitudes [deg], which it projects to metres.
        scales: (4,) of [x, vx, y, vy] from the units of the measurements to those of the options;
            None if they are the same.
        origin: (4,) place [x, vx, y, vy] of the origin of the options at time 0, of dates in 1970,
            and its velocity, as that of a wind. Estimates are over ground, and `turn` is relative
            to the origin.
        lag: number of ticks after which a tick is decided again, from the measurements since; see
            `OnlineEstimate.settled`. None does not; only with unknown switches.
        process_share: share of the process noise that the options have, by which modes are decided,
            see `smooth_modes`; with a lag estimates are smoothed with the whole.

    >>> from baselines import ThresholdDecider
    >>> tracker = OnlineTracker(QuickestOptions(measurement_variance=0.01), ThresholdDecider(0.6))
    >>> for k in range(30):
    ...     now = tracker.update((0.2 * k, 0.0), time=0.1 * k)
    >>> now.mode, now.estimate.shape, now.covariance.shape
    (0, (4,), (4, 4))
    """

    # Number of measurements in a row that are far, late or repeated, after which the track begins
    # again: the object or the clock is elsewhere.
    patience = 5
    # Number of measurements after which a snapshot is taken, see `Snapshot`. A late measurement is
    # used if at most so many came before it.
    history = 50
    # Ticks between measurements above which a tracker warns of their unit.
    longest_step = 100
    # Ticks of the longest gap: each is predicted, and later no prediction is of use.
    longest_gap = 10_000

    def __init__(
        self,
        options: WorldOptions | QuickestOptions,
        decider: Decider,
        gate: float | None = 10.0,
        gap: float | None = None,
        projection: "Projection | None" = None,
        scales: ArrayLike | None = None,
        origin: ArrayLike = (0.0, 0.0, 0.0, 0.0),
        lag: int | None = None,
        process_share: float = 1.0,
    ):
        self.track = TurnTracks(options)
        self.options = options
        self.lag = None if lag is None else check_integer("lag", lag, 1, LARGEST_LAG)
        self._process_share = checked("process_share", process_share, Positive)
        if lag is not None and self.track.announced:
            raise reject("lag", lag, "None with announced switches")
        self.decider = as_decider(decider)
        self.gate = checked("gate", gate, Positive | None)
        self.units = SensorUnits(
            options.sensors,
            projection,
            np.ones(4) if scales is None else check_array("scales", scales, (4,)),
            check_array("origin", origin, (4,)),
        )
        self.tau = options.tau * self.units.second
        length, velocity = (1.0 / self.units.scales[:2]).tolist()
        names = names_of_modes(
            [
                in_units(mode, length, velocity, options.tau, options.speed)
                for mode in options.all_modes
            ]
        )
        self.mode_names = list(dict.fromkeys(names))
        self._places = np.array([self.mode_names.index(name) for name in names])
        given = 1000.0 * self.tau if gap is None else checked("gap", gap, Positive)
        self.gap = min(given, self.longest_gap * self.tau)
        self._model = np.array(options.radii, float), options.tau
        self._stops = any(mode.type == "stop" for mode in options.all_modes)
        self._noise = unit_noise(options)
        self._actions = self.options.action_count
        self._longest = options.longest_segment
        # Of the last measurement; without times it is counted from 0.
        self.time = 0.0
        # What was measured first, and when; whether the clock was set back; number of the last
        # measurements that were far apart in time.
        self._first: tuple[Fused | None, float] | None = None
        self._set_back = False
        self._apart = 0
        self._try_decider()
        if self.lag is not None:
            # Its code is compiled now, and not while the sensor measures.
            row = np.zeros(9 if self.options.sensors else 2)
            smoother = FixedLagSmoother(self.track.options, 1, row)
            for _ in range(2):
                smoother.step(row)
        self.begin()

    @classmethod
    def from_recording(
        cls,
        recording: Any,
        decider: Decider | None = None,
        gate: float | None = 10.0,
        lag: int | None = None,
    ) -> Self:
        """Return a tracker with all that was found on a recording with unknown switches: tick,
        noise, radii, durations, units and projection.

        Args:
            recording: what `agents.track_recording` returned, or the `track.json` that `hybridtrack
                track` has written.
            decider: for rows of the options, see `TrackModel.unknown_switches`; None is the rule of
                the recording.
            gate: as of the class.
            lag: likewise.
        """
        from baselines.recordings.settings import read_settings

        settings = read_settings(recording)
        return cls(
            settings.environment,
            settings.rule() if decider is None else decider,
            gate,
            settings.gap,
            settings.projection,
            settings.scales,
            settings.origin,
            lag,
            PROCESS_SHARE,
        )

    def begin(
        self,
        estimate: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        mode: int | None = None,
        time: float | None = None,
    ) -> None:
        """Begin a track, and forget the last one.

        Without an estimate a straight line is fitted to the first measurements, 3 with unknown and
        up to 10 with announced switches; one with a velocity is enough. The bank begins after the
        last of them; until then the estimate is that of the line, and all modes are equally
        probable.

        Args:
            estimate: (4,) [x, vx, y, vy] one tick before the first measurement, in the units of
                `OnlineEstimate.estimate`; None collects.
            covariance: (4, 4) of the estimate; None is that of the options, see `initial_error`.
            mode: before the first tick; None if it is not known.
            time: of the estimate, which matters if the origin moves; None is that of the last
                measurement.
        """
        self.time = self.time if time is None else time
        known = -1 if mode is None else check_integer("mode", mode, 0, self.options.hypotheses - 1)
        if estimate is None and covariance is not None:
            raise reject("covariance", covariance, "None without an estimate")
        collected: FirstMeasurements | None = None
        if estimate is not None:
            start = check_array("estimate", estimate, (4,))
            if covariance is None:
                start, _ = self.units.start(start, np.zeros((4, 4)), self.time)
                matrix = np.diag(self.options.start_variances)
            else:
                matrix = check_array("covariance", covariance, (4, 4))
                matrix = check_covariance("covariance", matrix, definite=False)
                start, matrix = self.units.start(start, matrix, self.time)
            self.track.begin(start, matrix, known)
        else:
            # A bank that runs on knows how inaccurate its estimate is, and corrects it. For one
            # that starts at a switch the centre of its turns follows from the estimate.
            most = 10 if self.track.announced else 3
            collected = FirstMeasurements(self.options, most)
        self.state = TrackState(
            mode=known,
            assumed=mode is None and not self.track.announced,
            clock=TickClock(self.tau),
            collected=collected,
            announced_ticks=self._longest,
        )
        self._heights: OnlineTracker | None = None
        self._late = 0.0
        # Number of the last measurements that were made before another one.
        self._behind = 0
        self._snapshots: list[Snapshot] = []

    def switch(self, ticks: int | None = None) -> None:
        """Announce that the next update is the first one after a switch, also `update(None)`.

        Some learned deciders read the number of ticks until the next switch; None assumes the
        longest segment.
        """
        if not self.track.announced:
            raise reject("switch", "an announced switch", "none with QuickestOptions")
        length = self._longest if ticks is None else checked("ticks", ticks, Ticks)
        self.state.announced_ticks = length

    def update(
        self,
        measurement: ArrayLike | dict[int, ArrayLike] | Fused | None,
        time: float | datetime | np.datetime64 | str | None = None,
        velocity: ArrayLike | None = None,
    ) -> OnlineEstimate:
        """Process a measurement, and return what is known after it.

        Args:
            measurement: (2,) position of variance R, in the units of the sensor, or latitude and
                longitude [deg] with a projection; (3,) with a height in the unit of the estimate,
                NaN if there is none; or what the sensors of the options measured, as a mapping from
                their place in the list: (x, y), (x, y, vx, vy), (range, bearing) or (range,
                bearing, range rate), bearings in radians; None or NaN if there is none.
            time: of the measurement in the unit of `tau`, or a date, also as text in the form of
                ISO 8601; None is one tick after the last one. A measurement whose time is NaN is
                dropped.
            velocity: (2,) that was measured with the position, as from speed and course over
                ground, in the units of `OnlineEstimate.estimate`; None or NaN if there is none. The
                options need one `Sensor` with a `velocity_variance`.

        Raises:
            ArgumentError: measurement, velocity or time have another form, or the measurement is
                missing and the decider cannot do without it.
        """
        given: Any = measurement
        pair = isinstance(given, (tuple, list)) and len(given) == 2
        if not (pair or isinstance(given, Fused)) and as_array(given).shape == (3,):
            *place, height = check_array("measurement", given, (3,), missing=True).tolist()
            known = self.update(tuple(place), time, velocity)
            return known._replace(height=self._height(height, self.time if time is None else time))
        moment = self.time + self.tau if time is None else number_of(time)
        point = self.units.measured(measurement, moment, velocity)
        if time is None:
            self.time = moment
            self.state.clock.tick()
            return self.advance(1, point)
        if not math.isfinite(moment):
            return self._known("dropped")
        last = self.state.time
        if last is not None and moment <= last:
            return self._out_of_order(point, moment)
        if last is not None and moment - last > self.gap:
            if point is None:
                return self._known("missing")
            self.begin()
        self._behind = 0
        if point is not None:
            near = self.longest_step * self.tau
            apart = last is None or not self.state.measured or moment - last > near
            self._apart = self._apart + 1 if apart else 0
            if self._apart == self.patience:
                warnings.warn(
                    f"the last {self.patience} measurements were more than {self.longest_step}"
                    f" ticks apart: are their times in the unit of tau={self.tau:.4g}?",
                    stacklevel=2,
                )
        return self._at_time(point, moment)

    def _height(self, height: float, time: Any) -> HeightEstimate:
        """Process a measured height, and return what is known after it. It is x of a plane whose y
        says nothing; modes are a level motion, whose filter forgets the rate, and any rate.
        """
        options, scales = self.options, self.units.scales
        tau, variance = options.tau, options.height_variance
        rate_variance = variance / tau**2
        if self._heights is None:
            # Both move y alike.
            F = np.diag([1.0, 0.0, 1.0, 1.0])
            F[2, 3] = tau
            Q = np.diag([1e-3 * variance, rate_variance, 0.0, options.climb_variance])
            vertical = QuickestOptions(
                modes=(LinearMode(F, np.zeros(4), Q, "stop"), Straight()),
                tau=tau,
                process_variance=options.climb_variance,
                measurement_variance=variance,
            )
            given = vertical, ThresholdDecider(), self.gate, self.gap
            self._heights = OnlineTracker(*given, scales=scales)
        known = self._heights.update((height, 0.0), time)
        estimate, covariance = known.estimate[:2], known.covariance[:2, :2]
        probabilities, side = np.zeros(3), 1 if estimate[1] > 0.0 else 2
        probabilities[[0, side]] = known.probabilities
        if self._heights.begun:
            # The rate of a level height is 0.
            level = probabilities[0] * rate_variance / scales[1] ** 2
            covariance[1, 1] = max(covariance[1, 1] - level, 0.0)
        return HeightEstimate(known.mode * side, probabilities, estimate, covariance, known.status)

    def _at_time(self, point: Fused | None, time: float) -> OnlineEstimate:
        """Process what was measured at a time after the last one."""
        if not self.track.announced:
            self._remember(point, time)
        self._first = self._first or (point, time)
        self.time = self.state.time = time
        ticks, late = self.state.clock.advance(time)
        if ticks == 0:
            return self._known("dropped")
        return self.advance(ticks, point, late)

    def _remember(self, point: Fused | None, time: float) -> None:
        """Keep a measurement, and by times the state before it."""
        snapshots = self._snapshots
        if not snapshots or len(snapshots[-1].times) >= self.history:
            arrays = {name: array.copy() for name, array in self.track.arrays().items()}
            before = -math.inf if self.state.time is None else self.state.time
            snapshot = Snapshot(before, copy.deepcopy(self.state), arrays, [], [])
            self._snapshots = snapshots = [*snapshots[-1:], snapshot]
        snapshots[-1].times.append(time)
        snapshots[-1].points.append(point)

    def _out_of_order(self, point: Fused | None, time: float) -> OnlineEstimate:
        """Process what was measured at the time of the last measurement or before."""
        kept = [
            known
            for snapshot in self._snapshots
            for known in zip(snapshot.times, snapshot.points, strict=True)
        ]
        if point is None:
            return self._known("missing")
        same = [earlier for moment, earlier in kept if moment == time]
        repeated = time == self.state.time or len(same) > 0
        if repeated and all(earlier == point for earlier in same):
            return self._known("repeated")
        self._behind += 1
        if self._behind == 1:
            moments = self.track.estimate(), self.track.covariance()
            place = self.units.at_time(point.position, time, self.time)
            goes_on = not self.begun or self._agrees(point._replace(position=place), *moments)
            self._set_back = goes_on or (point, time) == self._first
        if self._behind >= (self.patience if self._set_back else self.history):
            self.begin()
            return self._at_time(point, time)
        if repeated:
            return self._known("repeated")
        before = [
            snapshot
            for snapshot in self._snapshots
            if max(snapshot.time, snapshot.times[0] - self.gap) < time
        ]
        if not before:
            return self._known("dropped")
        snapshot = before.pop()
        again = [known for known in kept if known[0] > snapshot.time] + [(time, point)]
        self._snapshots = before
        self.state = snapshot.state
        self.track.restore(snapshot.arrays)
        for moment, earlier in sorted(again, key=operator.itemgetter(0)):
            known = self._at_time(earlier, moment)
        return known._replace(status="late")

    def advance(self, ticks: int, point: Fused | None, late: float = 0.0) -> OnlineEstimate:
        """Advance by a number of ticks, and return what is known at the last one.

        Args:
            ticks: at least 1.
            point: what was measured in the last one, in the units of the options; None is nothing.
            late: time of the measurement less that of its tick, in the unit of `tau`.
        """
        state = self.state
        track = self.track
        self._late = late / self.units.second
        missing = (ticks - (point is not None)) * state.measured
        status: Status = "used" if state.measured else "begun"
        if state.collected is not None:
            if not self._begins_after(state.collected, point, missing):
                return self._known("missing" if point is None else status)
            missing = 0
        for k in range(missing):
            if point is None and k == missing - 1:
                # The tick of `update(None)` itself.
                self._begin_announced()
            self._step()
        if point is None:
            return self._known("missing")
        state.measured = True
        self._begin_announced()
        used = self._use(point, ticks)
        known = self._known(status if used == "used" else used)
        # The track begins anew; with announced switches in the same segment.
        if state.far >= self.patience:
            estimate = track.estimate()
            clock, length, assumed = state.clock, track.ticks_left, state.assumed
            self.begin(mode=track.mode)
            self.state.time = state.time
            self.state.clock = clock
            self.state.announced_ticks = length
            self.state.assumed = assumed
            assert self.state.collected is not None
            # Until the first of them.
            self.state.collected.estimate = estimate
        return known

    def forecast(self, seconds: ArrayLike, stated: bool = False) -> Moments:
        """Return the means (k, 2) and the covariances (k, 2, 2) of the position k times after the
        last measurement, as long as the mode does not change; see `forecast.forecast`. Lengths are
        those of `OnlineEstimate.estimate`. NaN until the bank has begun.

        Args:
            seconds: (k,) times ahead, at least 0, in the unit of `tau`.
            stated: only of the stated mode; otherwise with the doubt about it.
        """
        times = check_times(seconds) / self.units.second + self._late
        if not self.begun:
            return np.full((len(times), 2), np.nan), np.full((len(times), 2, 2), np.nan)
        means, covariances = self.track.forecast(times.clip(0.0), stated)
        length = self.units.scales[0]
        origin = self.units.origin_at(self.time + np.asarray(seconds, float))
        return means / length + origin[..., ::2], covariances / length**2

    @property
    def world(self) -> World:
        """The arrays of the bank, with the row that the decider has read."""
        return self.track.world

    @property
    def begun(self) -> bool:
        """Whether the bank has begun, after the first measurements."""
        return self.state.collected is None

    def _use(self, point: Fused, ticks: int) -> Status:
        """Advance by one tick with a measurement, or without it if it is not used."""
        state = self.state
        before = self.track.estimate(), self.track.covariance()
        if math.isnan(point.position[0]):
            # A bearing or a range alone.
            self._step(point, before)
            return "used"
        stale = self._is_stale(point.position, before[0], ticks)
        state.repeats = (state.repeats + 1) * stale
        if stale and state.repeats <= self.patience:
            self._step()
            return "repeated"
        point = self._at_tick(point, *before)
        agrees = self._agrees(point, *before)
        state.agreed = (state.agreed + 1) * agrees
        if not agrees:
            state.far += 1
            self._step()
            return "far"
        # A single one may agree only because its prediction is so uncertain.
        state.far *= state.agreed < 2
        self._step(point, before)
        return "used"

    def _settle(self, point: Fused | None, start: Moments | None = None) -> None:
        """Decide the tick `lag` ticks ago again, after a tick with or without a measurement.

        Args:
            point: what was measured, moved to the tick.
            start: estimate and covariance one tick before the first measurement of a track.
        """
        state = self.state
        if self.lag is None or (state.smoother is None and point is None):
            return
        row = np.full(9 if self.options.sensors else 2, np.nan)
        if point is not None:
            row[:2] = point.position
        if point is not None and self.options.sensors:
            noise = self._noise if point.covariance is None else np.array(point.covariance)
            row[2:5] = noise / self._noise[0]
            row[5 : 5 + len(point.rates)] = point.rates
        if state.smoother is None:
            whole = replace(
                self.track.options,
                process_variance=self.track.options.process_variance / self._process_share,
            )
            arguments = whole, self.lag, row, start
            state.smoother = FixedLagSmoother(*arguments, self._process_share)
        settled = state.smoother.step(row)
        if settled is not None and not self.units.same:
            moments = settled.estimate, settled.covariance
            moments = self.units.moments(*moments, self._settled_time)
            settled = settled._replace(estimate=moments[0], covariance=moments[1])
        state.settled = settled

    @property
    def _settled_time(self) -> float:
        """Time of the tick `lag` ticks ago."""
        return self.time - self._late * self.units.second - (self.lag or 0) * self.tau

    def _step(self, point: Fused | None = None, before: Moments | None = None) -> None:
        """Advance by one tick with a measurement, or without one; `before` is as the start of
        `_settle`. The decider is asked where it may be or is at every tick, and its action applied
        if it counts.
        """
        track = self.track
        track.measure((np.nan, np.nan) if point is None else point.position, point)
        self._settle(point, before)
        if track.asks and (self.decider.every_tick or (point is not None and track.counts)):
            action = self._ask_decider()
            if track.counts:
                track.decide(action)

    def _at_tick(self, point: Fused, estimate: FloatArray, covariance: FloatArray) -> Fused:
        """Return what was measured, moved to its tick along the estimated velocity, unless that is
        so uncertain that the error would be larger than that of the measurement.
        """
        late = self._late
        if not late:
            return point
        x, y = point.position
        if late * late * covariance.item(1, 1) < self._noise.item(0):
            x -= late * estimate.item(1)
        if late * late * covariance.item(3, 3) < self._noise.item(2):
            y -= late * estimate.item(3)
        return point._replace(position=(x, y))

    def _is_stale(self, position: tuple[float, float], estimate: FloatArray, ticks: int) -> bool:
        """Return whether a source without a new position has repeated the last one: the object has
        moved by more than rounding of the positions explains.
        """
        state = self.state
        last, state.position = state.position, (position, self.time)
        if last is None:
            return False
        x, y = self.units.at_time(*last, self.time)
        rounding = 0.0
        if self.units.moves:
            # Dates since 1970 make the origin large.
            origin = self.units.scales * self.units.origin_at(self.time)
            rounding = 1e-15 * float(np.abs(origin).max())
        steps = abs(position[0] - x), abs(position[1] - y)
        for step in steps:
            if rounding < step < state.digit:
                state.digit = step
        if max(steps) > rounding:
            return False
        _, vx, _, vy = estimate.tolist()
        return math.hypot(vx, vy) * ticks * self.options.tau > 5.0 * state.digit

    def _agrees(self, point: Fused, estimate: FloatArray, covariance: FloatArray) -> bool:
        """Return whether a motion of the track explains a measurement."""
        if self.gate is None:
            return True
        noise = self._noise if point.covariance is None else np.array(point.covariance)
        seen = np.array(point.position), estimate, covariance
        ticks = self.track.uncertain_ticks
        return (
            run_compiled(gate_distance, *seen, *self._model, noise, ticks, self._stops) <= self.gate
        )

    def _begin_announced(self) -> None:
        """Begin the segment that `switch` has announced, if there is one."""
        if self.state.announced_ticks is not None:
            self.track.begin_segment(self.state.announced_ticks)
            self.state.announced_ticks = None

    def _begins_after(
        self, collected: FirstMeasurements, point: Fused | None, missing: int
    ) -> bool:
        """Collect a measurement after missing ones; return whether the bank has begun before it
        instead.
        """
        state = self.state
        for _ in range(missing):
            collected.skip()
            self._settle(None)
        if point is None:
            return False
        if collected.complete:
            self.track.begin(collected.estimate, collected.covariance, state.mode)
            state.collected = None
            return True
        if math.isnan(point.position[0]):
            collected.skip()
            return False
        collected.add(*point.position, point.covariance, self._late, point.rates)
        self._settle(self._at_tick(point, collected.estimate, collected.covariance))
        state.measured = True
        state.position = point.position, self.time
        if state.announced_ticks is not None:
            state.announced_ticks = max(state.announced_ticks - 1, 1)
        return False

    def _ask_decider(self) -> int:
        """Return the action of the decider on the present row."""
        state = self.state
        seen = self.decider.observe(self.world)
        first = np.array([state.episode_start])
        levels = self.decider.panel().thresholds.values() if state.assumed else ()
        evidence = self.track.probabilities() if state.assumed else None
        if levels:
            evidence = self.decider.evidence(seen, state.decider_state, first)[0]
        given = self.decider, self._actions, seen, state.decider_state, first
        actions, state.decider_state = ask(*given)
        action = operator.index(actions[0])
        if evidence is not None:
            # A decider without a threshold changes its statement at any evidence.
            swept = len(self.decider.thresholds) > 0
            changed = swept and not state.episode_start and action != self.track.mode
            state.assumed = not changed and evidence[action] < min(levels, default=0.5)
        state.episode_start = False
        return action

    def _known(self, status: Status) -> OnlineEstimate:
        """Return what is known now."""
        state = self.state
        track = self.track
        if state.collected is not None:
            mode, decided = max(state.mode, 0), False
            probabilities = np.full(self._places.size, 1.0 / self._places.size)
            estimate = state.collected.estimate.copy()
            covariance = state.collected.covariance.copy()
            xx, xy, _, yy = covariance[1::2, 1::2].ravel().tolist()
            _, vx, _, vy = estimate.tolist()
            speed, deviation = speed_of(vx, vy, xx, xy, yy)
            turn = TurnEstimate(speed, deviation, math.nan, math.nan)
        else:
            mode, decided = track.mode, track.decided and not state.assumed
            probabilities = track.probabilities()
            estimate = track.estimate()
            covariance = track.covariance()
            turn = track.turn()
        if self._late:
            estimate[::2] += self._late * estimate[1::2]
        units = self.units
        estimate, covariance = units.moments(estimate, covariance, self.time)
        settled = state.settled
        if settled is not None and state.time is not None:
            settled = settled._replace(
                time=self._settled_time,
                mode=self._places.item(settled.mode),
                probabilities=self._of_names(settled.probabilities),
            )
        return OnlineEstimate(
            self._places.item(mode),
            decided,
            self._of_names(probabilities),
            estimate,
            covariance,
            status,
            units.place(estimate),
            turn if units.same else units.turn(turn),
            settled,
        )

    def _of_names(self, probabilities: FloatArray) -> FloatArray:
        """Return the probabilities of the modes by `mode_names`."""
        return np.asarray(np.bincount(self._places, probabilities), float)

    def _try_decider(self) -> None:
        """Ask the decider about a row, so that its code is compiled and a wrong decider is found
        at once.
        """
        options = self.options
        track = self.track
        start = np.array([0.0, options.speed, 0.0, 0.0])
        start, _ = self.units.moments(start, np.zeros((4, 4)), self.time)
        self.begin(start)
        track.begin_segment(self._longest)
        track.measure((options.speed * options.tau, 0.0))
        try:
            self._ask_decider()
        except Exception as error:
            environment = "HybridTrack-v0" if track.announced else "HybridTrackQuickest-v0"
            allowed = f"one for rows of {environment} with {options.hypotheses} hypotheses: {error}"
            raise reject("decider", name_of(self.decider), allowed) from error
