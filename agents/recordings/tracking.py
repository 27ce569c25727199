"""Tracking of one recording: options of the command and of the function."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agents.evaluation.registry import ErrorArguments, load_decider, needed_options, parse_name
from agents.recordings.tracked_recording import TrackedRecording, row_results
from baselines.recordings.altitude import vertical_motion
from baselines.recordings.decisions import RowDecisions, decide_piece, smooth_piece
from baselines.recordings.imm_pass import TrackModel
from baselines.recordings.model_fit import check_consistency, check_radii, fit_model, with_stop
from baselines.recordings.recording import Recording, make_recording
from baselines.recordings.scatter import without_errors, without_standing
from baselines.recordings.ticks import TickGrid, tick_grid
from baselines.recordings.tracker import OnlineTracker
from baselines.recordings.wind import circles_of, find_wind
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Decider, rules
from hybrid_env.checks import (
    ArgumentError,
    FloatArray,
    Positive,
    PositiveOrZero,
    check_array,
    check_fields,
    of_keywords,
    reject,
)
from hybrid_env.durations import parse_durations
from hybrid_env.limits import Ticks, distinct_radii
from hybrid_env.modes import planar_modes
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Radar


class _Found(NamedTuple):
    """What decides the rows of a recording."""

    # The rows as seen from the ground, and from the medium.
    grid: TickGrid
    seen: TickGrid
    model: TrackModel
    # See `TrackedRecording`.
    standing: int
    tracker: OnlineTracker

    @property
    def stands(self) -> bool:
        """Whether the object stands in a part."""
        return self.standing > 0 or any(mode.type == "stop" for mode in self.model.all_modes)


@dataclass(kw_only=True)
class TrackingArguments(ErrorArguments):
    """How a recording is tracked. What is not given is found from the recording, in any units."""

    lengths: tuple[Ticks, ...] = ()
    """Ticks of each piece between known switches, with the number of ticks as their sum; a single
    number is the length of every piece. By default the switches are not known.
    """
    live: bool = False
    """Decide and estimate every row from the rows up to it, as a live sensor would; by default from
    all of them.
    """
    decider: str | None = None
    """With --live: a rule, 'shipped' or a run folder, with an optional ':threshold'. By default
    steady, and with --lengths msprt-aware.
    """
    radii: tuple[float, ...] = ()
    """Turn radii, each tested as a left and as a right turn [unit of the recording]. By default
    found from the recording. Without effect with modes.
    """
    modes: str | tuple[str, ...] | None = None
    """Modes of the object, as in 'straight, left 200, right 200, stop' [unit of the recording]. By
    default straight motion, the turns of the radii, and a stop if the object stands in a part.
    """
    measurement_variance: Positive | None = None
    """Measurement noise variance R of each coordinate. By default the one with the largest
    likelihood."""
    process_variance: PositiveOrZero | None = None
    """Process noise variance Q of each velocity in a tick. By default the one with the largest
    likelihood."""
    durations: str | None = None
    """Law of the durations of the modes in ticks, such as 'geometric 75' or '25 + geometric 50'. By
    default geometric with the mean that the recording shows.
    """
    initial_state: tuple[float, float, float, float] | None = None
    """Exact state x, vx, y, vy one tick before the first measurement; by default from the
    measurements.
    """

    def check_tracking(self) -> None:
        """Check the arguments before any work."""
        if self.radii:
            distinct_radii(self.radii)
        planar_modes(self.modes)
        if self.durations is not None:
            parse_durations(self.durations)
        if self.decider and not self.live:
            raise reject("decider", self.decider, "none without live")
        announced = self.live and self.lengths
        task, other = (ANNOUNCED, UNKNOWN) if announced else (UNKNOWN, ANNOUNCED)
        if parse_name(self._decider_name()).base in rules(other):
            remedy = "with --lengths" if self.lengths else "or give --lengths"
            raise reject("decider", self.decider, f"{', '.join(rules(task))} or an agent, {remedy}")

    def track(self, recording: Recording) -> TrackedRecording:
        """Track a recording; the arguments are checked before."""
        if recording.radar is not None and self.measurement_variance is not None:
            variance = self.measurement_variance
            raise reject("measurement_variance", variance, "none with radar, which has its own")
        grid, outliers = without_errors(tick_grid(recording), jumps=not self.lengths)
        found = self._found(recording, grid, np.zeros(2))
        # A wind is looked for in what hindsight decides, unless the object stands: that is over
        # ground.
        searched = not (self.lengths or grid.radar or found.stands)
        decisions = self._rows(recording, found, self.live and not searched)
        if searched:
            times = [piece.times(recording.times) for piece in found.grid.pieces]
            circles = circles_of(found.grid, times, decisions, found.model.all_modes)
            wind = find_wind(circles)
            if wind.any():
                found = self._found(recording, grid, wind)
            if self.live or wind.any():
                decisions = self._rows(recording, found, self.live)
        lengths = self._lengths(grid)
        innovations, warnings = check_consistency(found.seen, found.model, lengths)
        unlikely = 0 if lengths or not self.live else sum(map(unlikely_rows, decisions))
        if unlikely:
            warnings.append(
                f"the stated mode is improbable for long, in {unlikely} rows: the threshold of"
                " the decider may be too high for another one to be stated"
            )
        vertical = None
        if recording.altitudes is not None and not self.live:
            vertical = vertical_motion(recording.times, recording.altitudes, recording.pieces)
        return TrackedRecording(
            recording=recording,
            vertical=vertical,
            model=found.model,
            wind=found.tracker.units.origin[1::2],
            decider=self._named(found.tracker.decider),
            grid=found.grid,
            outliers=outliers,
            standing=found.standing,
            warnings=warnings,
            durations=self.durations,
            known_switches=bool(lengths),
            live=self.live,
            **row_results(recording, found.grid.pieces, decisions, innovations),
        )

    def _found(self, recording: Recording, grid: TickGrid, wind: FloatArray) -> _Found:
        """Find the model of a recording in a medium with a velocity (2,)."""
        modes = planar_modes(self.modes) or ()
        lengths = self._lengths(grid)
        seen = grid.moving(recording.times, wind) if wind.any() else grid
        nothing = seen, 0, 0.0
        moving, standing, longest = nothing if self.lengths or modes else without_standing(seen)
        duration = None if self.durations is None else parse_durations(self.durations).mean_duration
        variances = self.measurement_variance, self.process_variance
        given = self.radii or None, *variances, duration, lengths, modes
        model = fit_model(moving, *given)
        stops = with_stop(seen, model, fit_model(seen, *given), longest) if standing else model
        check_radii(stops)
        # A live rule is told of switches; hindsight has one model of both.
        of_rule = lengths if self.live else []
        try:
            tracker = self._tracker(of_rule, grid, stops, wind)
            model, standing = stops, 0
        except ArgumentError:
            if modes or not stops.modes:
                raise
            # The decider may know only straight motion and turns.
            seen = moving
            grid = seen.moving(recording.times, -wind) if wind.any() else seen
            tracker = self._tracker(of_rule, grid, model, wind)
        return _Found(grid, seen, model, standing, tracker)

    def _rows(self, recording: Recording, found: _Found, live: bool) -> list[RowDecisions]:
        """Decide the rows of each piece, live or with hindsight."""
        lengths = self._lengths(found.grid)
        start = None if self.initial_state is None else np.array(self.initial_state)
        grid, tracker = found.grid, found.tracker
        if live:
            return [decide_piece(recording, each, tracker, lengths, start) for each in grid.pieces]
        options = found.model.unknown_switches(self.durations, grid.longest, grid.radar)
        seen = options, tracker.units, lengths, start
        return [smooth_piece(recording, each, *seen) for each in grid.pieces]

    def _decider_name(self) -> str:
        announced = self.live and self.lengths
        return self.at_error(self.decider or ("msprt-aware" if announced else "steady"))

    def _named(self, decider: Decider) -> str:
        """Return the name of a decider with its threshold, if it has one."""
        name = self._decider_name()
        parts = parse_name(name)
        if len(decider.thresholds) < 2 or parts.second is not None:
            return name
        return f"{parts.base}:{float(decider.threshold)}"

    def _lengths(self, grid: TickGrid) -> list[int]:
        """Return the ticks between known switches."""
        lengths = list(self.lengths)
        total = grid.total
        if len(lengths) == 1:
            lengths = [min(lengths[0], total - first) for first in range(0, total, lengths[0])]
        allowed = f"lengths whose sum is {total}, the number of ticks, not {sum(lengths)}"
        if len(grid.pieces) > 1:
            allowed = f"none with {len(grid.pieces) - 1} gaps, or a longer --gap"
        if lengths and (len(grid.pieces) > 1 or sum(lengths) != total):
            raise reject("lengths", tuple(lengths), allowed)
        return lengths

    def _tracker(
        self, lengths: list[int], grid: TickGrid, model: TrackModel, wind: FloatArray
    ) -> OnlineTracker:
        """Return a tracker with the model and the decider."""
        name = self._decider_name()
        options = model.options(grid.radar)
        world: WorldOptions | QuickestOptions
        try:
            if lengths:
                # An episode for deciders that are fitted by simulation has so many.
                segments = min(len(lengths), 6)
                options |= needed_options(name, ANNOUNCED)
                world = WorldOptions(
                    **options, scheme=f"random {segments}x{min(lengths)}-{max(lengths)}"
                )
            else:
                world = model.live.unknown_switches(self.durations, grid.longest, grid.radar)
        except ArgumentError as error:
            if str(error).startswith(tuple(model.options())):
                raise ArgumentError(model.cause() or f"the filters: {error}") from None
            raise
        x, y = (0.0, 0.0) if grid.radar is None else grid.radar.position
        origin = x, float(wind[0]), y, float(wind[1])
        return OnlineTracker(world, load_decider(name, world), scales=model.scales, origin=origin)


def track_recording(
    times: ArrayLike | None, positions: ArrayLike, radar: Radar | None = None, **options: Any
) -> TrackedRecording:
    """Decide between straight motion, left and right turns and stops, or other modes, on positions,
    as `hybridtrack track` does.

    Args:
        times: (n,) increasing times of the rows; None for rows at uniform ticks.
        positions: (n, 2) measured x and y in any unit, or (n, 4) also vx and vy, NaN without a
            measurement; with a radar its range, bearing, counter-clockwise from the x axis [rad],
            and by option range rate, (n, 2) or (n, 3).
        radar: that measured, in the same units.
        options: see `TrackingArguments`; the defaults are those of the command.

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """
    arguments = of_keywords(TrackingArguments, options)
    check_fields(arguments)
    arguments.check_tracking()
    if radar is None:
        values = check_array("positions", positions, (None, None), missing=True)
        if values.shape[1] not in (2, 4):
            raise reject("positions shape", values.shape, "(n, 2), or (n, 4) with velocities")
        return arguments.track(make_recording(times, values[:, :2], rates=values[:, 2:]))
    values = check_array("positions", positions, (None, radar.values), missing=True)
    if (values[:, 0] < 0.0).any():
        raise reject("positions", float(np.nanmin(values[:, 0])), "ranges >= 0")
    located = [radar.located(row)[:2] for row in values]
    return arguments.track(make_recording(times, located, radar=radar, rates=values[:, 2:]))


def unlikely_rows(decisions: RowDecisions) -> int:
    """Return the number of rows in runs of 20 and more, longer than decisions take, whose stated
    mode has a probability below .05.
    """
    of_mode = decisions.probabilities[np.arange(len(decisions.modes)), decisions.modes]
    borders = np.flatnonzero(np.diff(of_mode < 0.05, prepend=False, append=False))
    rows = np.diff(borders)[::2]
    return int(rows[rows >= 20].sum())
