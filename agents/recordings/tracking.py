"""Tracking of one recording: options of the command and of the function, and what is known
afterwards, row by row.
"""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agents.evaluation.chosen_threshold import reachable
from agents.evaluation.registry import (
    ErrorArguments,
    base_name,
    find_decider,
    given_threshold,
    is_policy_or_external,
    load_decider,
    needed_options,
    shipped_names,
)
from baselines.recordings.consistency import Consistency, check_consistency
from baselines.recordings.decisions import (
    ModelUnits,
    TickDecisions,
    check_lengths,
    decide_piece,
)
from baselines.recordings.model_fit import TrackModel, fit_model
from baselines.recordings.recording import Recording, make_recording
from baselines.recordings.scatter import standing_ticks, without_jumps, without_outliers
from baselines.recordings.ticks import TickGrid, tick_grid
from baselines.rules.decider import ANNOUNCED, UNKNOWN, rules
from baselines.rules.tracker import OnlineTracker
from hybrid_env.checks import (
    ArgumentError,
    BoolArray,
    FloatArray,
    IntArray,
    Positive,
    PositiveOrZero,
    check_array,
    check_fields,
    reject,
)
from hybrid_env.durations import GeometricDurations, parse_durations
from hybrid_env.limits import MAX_LENGTH, Ticks, distinct_radii
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Radar

# Probability of a stated mode in successive rows, more than decisions take.
UNLIKELY, LONG = 0.05, 20


@dataclass(frozen=True, eq=False)
class TrackedRecording:
    """A recording of n rows with its M modes, in its own units.

    Rows before the first and after the last measurement, and rows inside of gaps, have mode -1 and
    NaN.

    Attributes:
        recording: as it was read.
        model: noise, radii and durations that the filters assume, and which of them were estimated.
        decider: its name.
        modes: (n,) 0 straight, 1 .. left turns and then right turns, in the order of `model.radii`.
        decided: (n,) False before a mode was decided: at the start, and with known switches in each
            piece.
        probabilities: (n, M) of the modes at each row, from the measurements up to it.
        estimates: (n, 4) [x, vx, y, vy] from the measurements up to the row.
        covariances: (n, 4, 4) of the estimates.
        residuals: (n, 2) normalised innovations, N(0, 1) if the model holds; NaN without one.
        pieces: (K, 4) first row, end, mode and row of the decision of each piece, counted from 0;
            -1 for a piece without a decision.
        consistency: agreement of model and measurements.
        tau: tick of the filters.
        shared: number of rows whose tick is that of another row, with which they are averaged.
        moved: root mean square of the times by which rows were moved to their ticks, over the tick.
        outliers: number of measurements that were not used, because they are far from their
            neighbours.
        standing: number of ticks in which the object stands still.
        unlikely: number of rows whose stated mode is improbable for long, with unknown switches.
    """

    recording: Recording
    model: TrackModel
    decider: str
    modes: IntArray
    decided: BoolArray
    probabilities: FloatArray
    estimates: FloatArray
    covariances: FloatArray
    residuals: FloatArray
    pieces: IntArray
    consistency: Consistency
    tau: float
    shared: int
    moved: float
    outliers: int
    standing: int = 0
    unlikely: int = 0

    @property
    def warnings(self) -> list[str]:
        """Plain sentences about what does not fit."""
        sentences = self.consistency.warnings(self.model) + self._bent()
        if self.standing:
            sentences.append(
                f"the object stands still in {self.standing} ticks, whose modes have no meaning:"
                " cut them out"
            )
        if self.unlikely:
            sentences.append(
                f"the stated mode has a probability below {UNLIKELY:g} in {self.unlikely} rows: the"
                " threshold of the decider may be too high for another one to be stated"
            )
        return sentences

    def _bent(self) -> list[str]:
        """A sentence if the arc of the bearing error of a radar is bent more than the filters
        allow, see `Radar`.
        """
        # Bend of an arc of the length of the bearing error over the range deviation, see `Radar`.
        most_bent = 0.25
        recording, radar = self.recording, self.recording.radar
        if radar is None:
            return []
        farthest = float(
            np.hypot(*(recording.positions[recording.measured] - radar.position).T).max()
        )
        bend = farthest * radar.bearing_deviation**2 / radar.range_deviation
        if bend <= most_bent:
            return []
        return [
            "the bearing error is too large for the range deviation (range * deviation^2 is"
            f" {bend:.2g} of it, at most {most_bent:g} is consistent): errors are larger than the"
            " covariances say"
        ]

    def mode_names(self) -> list[str]:
        """Names of the modes: S, L, R, with the radius if there are several."""
        radii = self.model.radii
        shown = [f" {radius:.4g}" if len(radii) > 1 else "" for radius in radii]
        return ["S", *(f"{turn}{text}" for turn in "LR" for text in shown)]

    def of_modes(self, modes: IntArray) -> tuple[NDArray[Any], FloatArray]:
        """Return the letters S, L and R and the radii of modes, empty and NaN where there is
        none.
        """
        radii = self.model.radii
        letters = np.array(["S", *"L" * len(radii), *"R" * len(radii), ""])
        return letters[modes], np.array([np.nan, *radii, *radii, np.nan])[modes]


@dataclass(kw_only=True)
class TrackingArguments(ErrorArguments):
    """How a recording is tracked. What is not given is found from the recording, in any units."""

    lengths: tuple[Ticks, ...] = ()
    """Ticks of each piece between known switches, with the number of ticks as their sum; a single
    number is the length of every piece. By default the switches are not known.
    """
    decider: str | None = None
    """A rule, 'shipped' or a run folder, with an optional ':threshold'. By default threshold (IMM),
    and with --lengths msprt-aware.
    """
    radii: tuple[float, ...] = ()
    """Turn radii, each tested as a left and as a right turn [unit of the recording]. By default
    found from the recording.
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
    bank: Literal["published", "anchor_aware"] | None = None
    """Filters for known switches; by default those of the decider."""
    undecided: Literal["keep", "likeliest"] = "likeliest"
    """Mode of a piece without a decision: that of the previous piece (keep), or the most likely
    one.
    """
    recalculation: bool = False
    """With --lengths: after a decision, recalculate the estimates since the switch by the filter of
    the decided mode. They then use measurements up to the decision.
    """
    refine_radius: bool = False
    """With --lengths: after a decision, go on with the likeliest radius of the decided type. Needs
    several radii.
    """
    start: tuple[float, float, float, float] | None = None
    """Exact state x, vx, y, vy one tick before the first measurement; by default from the
    measurements.
    """

    def check_tracking(self) -> None:
        """Check the arguments before any work."""
        if self.radii:
            distinct_radii(self.radii)
        if self.durations is not None:
            parse_durations(self.durations)
        for name in ("bank", "recalculation", "refine_radius"):
            if getattr(self, name) and not self.lengths:
                nothing = "none" if name == "bank" else "False"
                raise reject(
                    name,
                    getattr(self, name),
                    f"{nothing} without lengths: modes are then stated, by the IMM",
                )
        announced = rules(ANNOUNCED)
        unknown = rules(UNKNOWN)
        name = base_name(self._decider_name())
        known = *announced, *unknown, *shipped_names(ANNOUNCED, UNKNOWN)
        if name not in known and not is_policy_or_external(name):
            raise reject(
                "decider",
                self.decider,
                f"{', '.join(known)}, a run folder, model.zip or mine.py:MyRule",
            )
        fitting, others = (announced, unknown) if self.lengths else (unknown, announced)
        if name in others:
            remedy = " with --lengths" if self.lengths else ", or give --lengths"
            raise reject("decider", self.decider, f"{', '.join(fitting)} or an agent{remedy}")

    def track(self, recording: Recording) -> TrackedRecording:
        """Track a recording."""
        self.check_tracking()
        if recording.radar is not None and self.measurement_variance is not None:
            raise reject(
                "measurement_variance",
                self.measurement_variance,
                "none with radar, which has its own",
            )
        grid = tick_grid(recording)
        outliers = 0
        # The noise of a radar depends on the range.
        if grid.radar is None:
            grid, bursts = (grid, 0) if self.lengths else without_jumps(grid)
            grid, outliers = without_outliers(grid)
            outliers += bursts
        lengths, total = list(self.lengths), grid.total
        if len(lengths) == 1:
            lengths = [min(lengths[0], total - first) for first in range(0, total, lengths[0])]
        check_lengths(grid, lengths)
        duration = None if self.durations is None else parse_durations(self.durations).mean_duration
        variances = self.measurement_variance, self.process_variance
        model = fit_model(grid, self.radii or None, *variances, duration, lengths)
        name = self._decider_name()
        try:
            tracker = self._tracker(name, lengths, grid, model)
        except ArgumentError as error:
            raise _in_units(error, model) from None
        start = None if self.start is None else np.array(self.start)
        decisions = [
            decide_piece(piece, grid.radar, model, tracker, lengths, start) for piece in grid.pieces
        ]
        consistency = check_consistency(grid, model, lengths)
        tracked = row_results(recording, grid, model, name, decisions, consistency, outliers)
        standing = standing_ticks(grid, model.measurement_variance, model.speed * model.tau)
        return replace(
            tracked,
            standing=standing,
            unlikely=0 if lengths else _unlikely_rows(tracked),
        )

    def _decider_name(self) -> str:
        return self.at_error(self.decider or ("msprt-aware" if self.lengths else "threshold"))

    def _tracker(
        self,
        name: str,
        lengths: Sequence[int],
        grid: TickGrid,
        model: TrackModel,
    ) -> OnlineTracker:
        options: dict[str, Any] = ModelUnits.of(model).options(model, grid.radar)
        world: WorldOptions | QuickestOptions
        if lengths:
            # Of an episode, for deciders that are fitted by simulation.
            segments = min(len(lengths), 6)
            scheme = f"random {segments}x{min(lengths)}-{max(lengths)}"
            given = {
                flag: getattr(self, flag)
                for flag in ("undecided", "recalculation", "refine_radius")
            }
            bank = {} if self.bank is None else {"bank": self.bank}
            world = WorldOptions(
                **options | {**needed_options(name, ANNOUNCED), **bank},
                **given,
                scheme=scheme,
            )
        else:
            law = GeometricDurations(model.duration) if self.durations is None else self.durations
            ticks = min(max(len(piece.measurements) for piece in grid.pieces), MAX_LENGTH)
            world = QuickestOptions(**options, durations=law, start="random", ticks=ticks)
            _warn_of_threshold(name, world)
        return OnlineTracker(world, load_decider(name, world))


def _warn_of_threshold(name: str, world: QuickestOptions) -> None:
    """Warn of a given threshold that not every mode reaches."""
    threshold = given_threshold(name)
    if threshold is None:
        return
    highest = reachable(find_decider(base_name(name), world), world)
    if threshold > highest:
        why = (
            f"with these durations and noise not every mode reaches more than {highest:.3g}, and it"
            " may never be stated"
        )
        warnings.warn(f"decider {name!r}: {why}: choose a smaller threshold", stacklevel=2)


def track_recording(
    times: ArrayLike | None,
    positions: ArrayLike,
    radar: Radar | None = None,
    **options: Any,
) -> TrackedRecording:
    """Decide between straight motion, left and right turns on positions, as `hybridtrack track`
    does.

    Args:
        times: (n,) increasing times of the rows; None for rows at uniform ticks.
        positions: (n, 2) measured x and y in any unit, NaN without a measurement; with a radar its
            range, bearing, counter-clockwise from the x axis [rad], and by option range rate, (n,
            2) or (n, 3).
        radar: that measured, in the same units.
        options: see `TrackingArguments`; the defaults are those of the command.

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """
    arguments = TrackingArguments(**options)
    check_fields(arguments)
    if radar is None:
        return arguments.track(make_recording(times, positions))
    values = check_array("positions", positions, (None, radar.values), missing=True)
    if (values[:, 0] < 0.0).any():
        raise reject("positions", float(np.nanmin(values[:, 0])), "ranges >= 0")
    located = [radar.located(row)[:2] for row in values]
    rates = values[:, 2] if radar.values == 3 else None
    return arguments.track(make_recording(times, located, radar=radar, rates=rates))


def _in_units(error: ArgumentError, model: TrackModel) -> ArgumentError:
    """Return the error of a model that the filters refuse, in the units of the recording."""
    of_model = str(error).startswith(
        ("radii", "speed", "measurement_variance", "process_variance", "tau")
    )
    if not of_model or not all(map(math.isfinite, model.radii)):
        return error
    radii = ", ".join(f"{radius:.4g}" for radius in model.radii)
    return ArgumentError(
        f"the filters cannot follow motion at {model.speed:.4g} per unit of time with R ="
        f" {model.measurement_variance:.4g}, Q = {model.process_variance:.4g}, radii {radii} and a"
        f" tick of {model.tau:.4g}: check units"
    )


def _unlikely_rows(tracked: TrackedRecording) -> int:
    """Return the number of rows in runs of `LONG` and more whose stated mode is less probable
    than `UNLIKELY`.
    """
    of_mode = tracked.probabilities[np.arange(len(tracked.modes)), tracked.modes]
    borders = np.flatnonzero(np.diff(of_mode < UNLIKELY, prepend=False, append=False))
    lengths = np.diff(borders)[::2]
    return int(lengths[lengths >= LONG].sum())


def row_results(
    recording: Recording,
    grid: TickGrid,
    model: TrackModel,
    decider: str,
    decisions: Sequence[TickDecisions],
    consistency: Consistency,
    outliers: int,
) -> TrackedRecording:
    """Return the results of the ticks of each piece at the rows of a recording."""
    rows = len(recording.times)
    M = 2 * len(model.radii) + 1
    pieces = []
    shapes = {
        "probabilities": (M,),
        "estimates": (4,),
        "covariances": (4, 4),
        "residuals": (2,),
    }
    arrays: dict[str, Any] = {"modes": np.full(rows, -1), "decided": np.zeros(rows, np.bool_)}
    arrays |= {name: np.full((rows, *shape), np.nan) for name, shape in shapes.items()}
    for piece, decided, innovations in zip(
        grid.pieces,
        decisions,
        consistency.innovations,
        strict=True,
    ):
        rows_of = slice(piece.first, piece.end)
        for name in ("modes", "decided", "probabilities", "estimates", "covariances"):
            arrays[name][rows_of] = getattr(decided, name)[piece.ticks]
        arrays["estimates"][rows_of, 0::2] += (
            piece.late[:, None] * arrays["estimates"][rows_of, 1::2]
        )
        arrays["residuals"][rows_of] = innovations[piece.ticks]
        table = decided.pieces.copy()
        for column in (0, 1, 3):
            at = np.searchsorted(piece.ticks, decided.pieces[:, column])
            table[:, column] = np.minimum(piece.first + at, piece.end)
        table[decided.pieces[:, 3] < 0, 3] = -1
        # A piece between two rows has none.
        pieces.append(table[table[:, 1] > table[:, 0]])
    arrays["residuals"][~recording.measured] = np.nan
    return TrackedRecording(
        recording=recording,
        model=model,
        decider=decider,
        pieces=np.concatenate(pieces),
        outliers=outliers,
        consistency=consistency,
        tau=grid.tau,
        shared=grid.shared,
        moved=grid.moved,
        **arrays,
    )
