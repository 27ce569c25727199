"""Tracking of one recording: options of the command and of the function, and what is known
afterwards, row by row.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agents.evaluation.registry import ErrorArguments, load_decider, needed_options, parse_name
from baselines.recordings.altitude import VerticalMotion, vertical_motion
from baselines.recordings.decisions import RowDecisions, decide_piece, smooth_piece
from baselines.recordings.imm_pass import TrackModel
from baselines.recordings.model_fit import check_consistency, check_radii, fit_model, with_stop
from baselines.recordings.recording import Recording, make_recording
from baselines.recordings.scatter import without_errors, without_standing
from baselines.recordings.ticks import Piece, TickGrid, tick_grid
from baselines.recordings.track_modes import letter, names_of_modes
from baselines.recordings.tracker import OnlineTracker
from baselines.recordings.wind import circles_of, find_wind
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Decider, rules
from hybrid_env.checks import (
    AnyArray,
    ArgumentError,
    BoolArray,
    FloatArray,
    IntArray,
    Positive,
    PositiveOrZero,
    check_array,
    check_fields,
    of_keywords,
    reject,
)
from hybrid_env.durations import parse_durations
from hybrid_env.limits import Ticks, distinct_radii
from hybrid_env.modes import parse_modes
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Radar


@dataclass(frozen=True, eq=False)
class TrackedRecording:
    """A recording of n rows with its M modes, in its own units.

    Rows before the first and after the last measurement, inside of gaps, and in parts in which the
    object stands still for a decider that knows no stop have mode -1 and NaN.

    Attributes:
        recording: as it was read.
        model: noise, radii and durations that the filters assume, and which of them were estimated.
        wind: (2,) velocity of the medium, a wind or a current; 0 without a sign of one. Speeds and
            radii are those in the medium, estimates those over ground.
        decider: of a live sensor with this model: its name, with its threshold.
        modes: (n,) in `model.all_modes`: by default 0 straight, 1 .. left turns and then right
            turns, in the order of `model.radii`, and the stop if the object stands in a part.
        decided: (n,) False where there is no mode; live also before one was decided: at the start,
            and with known switches in each piece.
        probabilities: (n, M) of the modes at each row, from all measurements, live from those up to
            it.
        estimates: (n, 4) [x, vx, y, vy], likewise.
        covariances: (n, 4, 4) of the estimates.
        turns: (n, 4) speed, its deviation, radius, its deviation, see `baselines.estimation.turns`;
            the radius is infinite where the object moves straight, and NaN where it stands and
            before a decision.
        residuals: (n, 2) normalised innovations, N(0, 1) if the model holds; NaN without one.
        pieces: (K, 4) first row, end, mode and row of the decision of each piece, counted from 0;
            -1 for a piece without a decision, and with hindsight.
        moments: (K, 2) times that hold the begin of each piece with a probability of .95; NaN live.
        vertical: climbs and descents, from all rows; None live and without altitudes.
        grid: its uniform ticks.
        outliers: number of measurements that were not used, because they are far from their
            neighbours.
        standing: number of measurements that were not used, because the object stands still and the
            decider knows no stop.
        warnings: plain sentences about what does not fit.
        durations: law of the durations of the modes [ticks] that was given.
        known_switches: whether the switches were known.
        live: whether a row has what a live sensor would have told, else what all rows say.
    """

    recording: Recording
    model: TrackModel
    wind: FloatArray
    decider: str
    modes: IntArray
    decided: BoolArray
    probabilities: FloatArray
    estimates: FloatArray
    covariances: FloatArray
    turns: FloatArray
    residuals: FloatArray
    pieces: IntArray
    moments: FloatArray
    vertical: VerticalMotion | None
    grid: TickGrid
    outliers: int
    standing: int
    warnings: list[str]
    durations: str | None = None
    known_switches: bool = False
    live: bool = False

    def mode_names(self) -> list[str]:
        """Names of the modes: S, L, R, with the radius if there are several, and stop."""
        return names_of_modes(self.model.all_modes)

    def of_modes(self, modes: IntArray) -> tuple[NDArray[Any], FloatArray]:
        """Return the letters S, L and R or the names, and the radii of modes, empty and NaN where
        there is none.
        """
        of_model = self.model.all_modes
        letters = np.array([*map(letter, of_model), ""])
        radii = [abs(mode.signed_radius) or np.nan for mode in of_model]
        return letters[modes], np.array([*radii, np.nan])[modes]

    def piece_table(self) -> dict[str, Any]:
        """Return the columns of modes.csv. Rows are counted from 1; cells that do not apply are
        empty.
        """
        recording = self.recording
        first, end, modes, when = self.pieces.T
        letters, radii = self.of_modes(modes)
        moments = {"begin": first, "end": end - 1}
        table = {
            **self._named(len(first)),
            "piece": np.arange(1, len(first) + 1),
            "first_row": first + 1,
            "last_row": end,
            "begin": recording.times[first],
            "end": recording.times[end - 1],
            "mode": letters,
            "radius": _unless(np.isnan(radii), radii),
        }
        if self.live:
            moments["decided"] = when
            table["decided_at"] = _unless(when < 0, recording.times[when])
            table["undecided"] = when < 0
        else:
            table["begin_low"], table["begin_high"] = self.moments.T
        if recording.time_cells is not None:
            table |= {
                f"{name}_time": _unless(rows < 0, recording.time_cells[rows])
                for name, rows in moments.items()
            }
        if self.vertical is not None:
            heights, times = self.vertical.altitudes, recording.times
            with np.errstate(invalid="ignore", divide="ignore"):
                rates = (heights[end - 1] - heights[first]) / (times[end - 1] - times[first])
            table["climb_rate"] = rates
        for name in ("begin", "end"):
            positions = self.estimates[moments[name], ::2]
            table |= {f"{name}_{axis}": positions[:, k] for k, axis in enumerate("xy")}
            table |= self._degrees(f"{name}_", positions)
        return table

    def climb_table(self) -> dict[str, Any]:
        """Return the columns of climbs.csv, of recordings with altitudes."""
        assert self.vertical is not None
        recording, vertical = self.recording, self.vertical
        first, end = vertical.pieces.T
        return {
            **self._named(len(first)),
            "piece": np.arange(1, len(first) + 1),
            "first_row": first + 1,
            "last_row": end,
            "begin": recording.times[first],
            "end": recording.times[end - 1],
            "motion": vertical.words(),
            "climb_rate": vertical.of_pieces[:, 0],
            "climb_rate_deviation": vertical.of_pieces[:, 1],
            "begin_altitude": vertical.altitudes[first],
            "end_altitude": vertical.altitudes[end - 1],
        }

    def row_table(self) -> dict[str, Any]:
        """Return the columns of estimates.csv, nan where there is no number."""
        state = ("x", "vx", "y", "vy")
        recording = self.recording
        triangle = [(i, j) for i in range(4) for j in range(i, 4)]
        letters, radii = self.of_modes(self.modes)
        # The column `radius` is that of the mode.
        turns = ("speed", "speed_deviation", "radius_estimate", "radius_deviation")
        file = {"line": recording.lines, "time": recording.time_cells}
        heights: dict[str, Any] = {}
        if self.vertical is not None:
            names = ("altitude", "estimate_altitude", "climb_rate", "climb_rate_deviation")
            columns = (recording.altitudes, *self.vertical[:3])
            heights = dict(zip(names, columns, strict=True))
        return {
            **self._named(len(recording.times)),
            **{name: cells for name, cells in file.items() if cells is not None},
            "t": recording.times,
            **dict(zip("xy", recording.positions.T, strict=True)),
            **self._degrees("", recording.positions),
            "mode": letters,
            "radius": radii,
            "decided": self.decided,
            **{
                f"p_{n.replace(' ', '_')}": self.probabilities[:, k]
                for k, n in enumerate(self.mode_names())
            },
            **{f"estimate_{name}": self.estimates[:, k] for k, name in enumerate(state)},
            **self._degrees("estimate_", self.estimates[:, ::2]),
            **dict(zip(turns, self.turns.T, strict=True)),
            **heights,
            **{f"cov_{state[i]}_{state[j]}": self.covariances[:, i, j] for i, j in triangle},
            **{f"residual_{axis}": self.residuals[:, k] for k, axis in enumerate("xy")},
        }

    def settings(self) -> dict[str, Any]:
        """Return the content of track.json: what `OnlineTracker.from_recording` needs, and what was
        left out, in plain values.
        """
        recording, model = self.recording, self.model
        radar = None if recording.radar is None else asdict(recording.radar)
        if radar is not None:
            # A recording has measurements of radars without limits only.
            del radar["period"], radar["range"]
        return {
            "object": recording.name,
            "unit": recording.unit,
            "time_unit": recording.time_unit,
            "epoch": recording.epoch,
            "wind": self.wind.tolist(),
            "projection": None if recording.projection is None else asdict(recording.projection),
            "radar": radar,
            "tick": float(model.tau),
            "gap": float(recording.gap),
            "measurement_variance": float(model.measurement_variance),
            "process_variance": float(model.process_variance),
            "drift_variance": float(model.drift_variance),
            "velocity_variance": float(model.velocity_variance),
            "radii": [float(radius) for radius in model.radii],
            "modes": [mode.as_json() for mode in model.modes],
            "duration": float(model.duration),
            "speed": float(model.speed),
            "estimated": list(model.estimated),
            "durations": self.durations,
            "ticks": max(len(piece.measurements) for piece in self.grid.pieces),
            "decider": self.decider,
            "known_switches": self.known_switches,
            "rows": len(recording.times),
            "left_out": dict(recording.left_out),
            "outliers": self.outliers,
            "standing": self.standing,
            "warnings": self.warnings,
        }

    def _named(self, rows: int) -> dict[str, list[str]]:
        """Return a column with the name of the object, none for arrays."""
        recording = self.recording
        return {} if recording.lines is None else {"object": [recording.name] * rows}

    def _degrees(self, prefix: str, positions: FloatArray) -> dict[str, FloatArray]:
        """Return the columns of latitude and longitude of positions, none without a projection."""
        projection = self.recording.projection
        if projection is None:
            return {}
        # Rounded to .1 mm, so that those of a file come back as they are there.
        degrees = projection.inverse(*positions.T).round(9)
        return {f"{prefix}lat": degrees[:, 0], f"{prefix}lon": degrees[:, 1]}


def _unless(empty: BoolArray, values: AnyArray) -> AnyArray:
    """Return the cells of a column, which are empty in some rows."""
    cells = values.astype(object)
    cells[empty] = ""
    return cells


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
        parse_modes(self.modes)
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
        """Track a recording."""
        self.check_tracking()
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
        modes = parse_modes(self.modes) or ()
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
        decide = decide_piece if live else smooth_piece
        arguments = found.tracker, lengths, start
        return [decide(recording, piece, *arguments) for piece in found.grid.pieces]

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
                longest = max(len(piece.measurements) for piece in grid.pieces)
                world = model.unknown_switches(self.durations, longest, grid.radar)
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


def row_results(
    recording: Recording,
    pieces: Sequence[Piece],
    decisions: Sequence[RowDecisions],
    innovations: Sequence[FloatArray],
) -> dict[str, Any]:
    """Return the arrays of a `TrackedRecording`: at its rows what is known at the rows of each
    piece.
    """

    def at_rows(of_pieces: Sequence[Any], empty: float | bool = np.nan) -> Any:
        array = np.full((len(recording.times), *of_pieces[0].shape[1:]), empty)
        for piece, values in zip(pieces, of_pieces, strict=True):
            array[piece.first : piece.end] = values
        return array

    residuals = at_rows(
        [values[piece.ticks] for piece, values in zip(pieces, innovations, strict=True)]
    )
    residuals[~recording.measured] = np.nan
    tables = []
    for piece, of_piece in zip(pieces, decisions, strict=True):
        table = of_piece.pieces + piece.first
        table[:, 2] = of_piece.pieces[:, 2]
        table[of_piece.pieces[:, 3] < 0, 3] = -1
        tables.append(table)
    return {
        "modes": at_rows([each.modes for each in decisions], -1),
        "decided": at_rows([each.decided for each in decisions], False),
        "probabilities": at_rows([each.probabilities for each in decisions]),
        "estimates": at_rows([each.estimates for each in decisions]),
        "covariances": at_rows([each.covariances for each in decisions]),
        "turns": at_rows([each.turns for each in decisions]),
        "residuals": residuals,
        "pieces": np.concatenate(tables),
        "moments": np.concatenate([each.moments for each in decisions]),
    }
