"""The command `hybridtrack track`: mode decisions with ATE on a recording of positions."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rich.markup import escape
from rich.table import Table

from agents.interface.output_files import Column, atomic_file, output_folder, write_table
from agents.recordings.figure import draw_track
from agents.recordings.file_arguments import TAU_RANGE, FileArguments, object_folders
from agents.recordings.many_files import Report, check_free, work_on_files
from baselines.deciders.sprt import sprt_thresholds
from baselines.recordings import ate
from baselines.recordings.recording import Recording
from hybrid_env.checks import (
    ArgumentError,
    check_array,
    check_between,
    check_choice,
    check_integer,
    check_positive,
    reject,
)
from hybrid_env.limits import distinct_radii
from hybrid_env.rendering.modes import mode_name

DEFAULT_PIECE = 50  # ticks
STEP_TOLERANCE = 1e-3
"""Largest relative deviation of a step from the median step."""

MAX_ESTIMATE = 1e15
"""Larger estimates [m, m/s] mean that the filter has diverged."""

MAX_PRINTED_PIECES = 20
MAX_PIECES = 200_000
MAX_RATIOS = 15_000_000
"""Largest number of rows times hypotheses, whose likelihood ratios are in memory."""

MIN_NOISE_ROWS = 50
"""The noise is not estimated from fewer measurements."""

NOISE_ERROR = 2.4
"""Relative standard error of the noise estimate times the square root of the number of rows.

Determined by simulation."""

NORMAL_MEDIAN = 0.6744897501960817
"""Median of |z| for a standard normal z."""


def estimate_noise(measurements: ArrayLike) -> float:
    """Estimate the measurement variance R from the third differences of each coordinate.

    d_k = z_{k+3} - 3 z_{k+2} + 3 z_{k+1} - z_k cancels motion that is quadratic over four ticks. Its noise
    has the variance (1 + 9 + 9 + 1) R. The median is robust against outliers and switches:

        R = (median |d_k| / 0.6745)^2 / 20, averaged over x and y.

    A turn adds about r (omega tau)^3 to |d|, and process noise adds Q tau^2 / 10 to R. Both are negligible if
    the tick is short. The relative standard error is about 2.4 / sqrt(T). The variance of noise that is
    correlated between ticks, for example after smoothing, is underestimated.

    Args:
        measurements: (T, 2) measured x and y [m], T >= 50.

    Returns:
        R [m^2].

    Raises:
        ArgumentError: there are too few measurements, or they show no noise.
    """
    values = check_array("measurements", measurements, (None, 2))
    if len(values) < MIN_NOISE_ROWS:
        raise reject(
            "measurement_variance",
            None,
            f"a number > 0, because its estimate needs {MIN_NOISE_ROWS} rows, not {len(values)}",
        )
    median = np.median(np.abs(np.diff(values, n=3, axis=0)), axis=0)
    variance = float(np.mean((median / NORMAL_MEDIAN) ** 2) / 20.0)
    # the third differences of a noise-free recording contain only the rounding of the coordinates
    if variance <= (8.0 * np.finfo(np.float64).eps * np.abs(values).max()) ** 2:
        raise reject("measurement_variance", None, "a number > 0, because the recording shows no noise")
    return variance


class _Result(NamedTuple):
    """Result of a recording."""

    lengths: list[int]
    tracks: ate.Tracks
    pieces: dict[str, list[Any]]
    line: str


@dataclass(kw_only=True)
class Track(FileArguments):
    """Run ATE on recordings: decide between straight, left and right turns, and estimate the trajectory.

    Writes modes.csv, estimates.csv and track.png. Ticks are counted from 1, the first row of the recording.
    """

    lengths: tuple[int, ...] = ()
    """Ticks of each piece between possible switches; their sum is the number of rows. See also --piece."""
    piece: int | None = None
    """Ticks between possible switches, if --lengths is not given; 50 by default."""
    radii: tuple[float, ...] = (5.0,)
    """Turn radii of the hypotheses [m]; each is tested as a left and as a right turn."""
    process_variance: float = 0.001
    """Process noise variance Q of each velocity per tick [m^2/s^2]."""
    measurement_variance: float | None = None
    """Measurement noise variance R of each coordinate [m^2]; by default estimated from the recording."""
    alpha: float = 1e-3
    """Error probability of the first kind: the active mode is rejected although it is correct."""
    beta: float | None = None
    """Error probability of the second kind: the active mode is kept although it is wrong. Default: alpha."""
    undecided: Literal["keep", "likeliest"] = "likeliest"
    """Mode of a piece without a decision: that of the previous piece (keep), or the most likely one."""
    start: tuple[float, float, float, float] | None = None
    """State x, vx, y, vy one tick before the first row [m, m/s]; by default from a line through ten rows."""

    def run(self) -> None:
        """Track the recordings, write the results and print the decisions.

        Raises:
            ArgumentError: an argument or a line of a file is invalid.
        """
        self._check()
        work_on_files(self.track_file, self.files, self.folders(), self.jobs)

    def track_file(self, path: Path, folder: Path) -> Report:
        """Track the recordings of a file. Nothing is written before all are tracked.

        Args:
            path: the file.
            folder: output folder, with one inside for each object if there are several.

        Raises:
            ArgumentError: the file is invalid, or a recording cannot be tracked.
        """
        check_free(folder, self.overwrite)
        found = self.read(path)
        results = [self._track(recording, path) for recording in found.recordings]
        lines, tables, files = [found.summary], [], []
        folders = object_folders(folder, [recording.name for recording in found.recordings])
        for recording, result, place in zip(found.recordings, results, folders, strict=True):
            lines.append(result.line)
            tables.append(_printed_table(result.pieces, recording.times, recording.tick))
            files += self._write(recording, result, place)
        return Report(tuple(lines), tables[0] if len(tables) == 1 else None, tuple(files))

    def _track(self, recording: Recording, path: Path) -> _Result:
        _check_uniform(recording, path)
        ticks = len(recording.times)
        lengths = self._lengths(ticks, path)
        tau = check_between("tau", recording.tick, *TAU_RANGE)
        variance = self.measurement_variance
        if variance is None:
            variance = estimate_noise(recording.positions)
        tracks = ate.track(
            recording.positions, lengths, self.start, radii=self.radii, tau=tau,
            process_variance=self.process_variance, measurement_variance=variance,
            alpha=self.alpha, beta=self.beta, undecided=self.undecided,
        )  # fmt: skip
        if not (np.abs(tracks.estimates) <= MAX_ESTIMATE).all():
            raise ArgumentError(
                f"the estimates of {path} diverge: expected coordinates, tick, start and variances in "
                "consistent units"
            )
        origin = "as given"
        if self.measurement_variance is None:
            origin = f"estimated, relative standard error {NOISE_ERROR / np.sqrt(ticks):.0%}"
        line = f"{recording.name}: {len(lengths)} pieces, measurement variance {variance:.4g} ({origin})"
        return _Result(lengths, tracks, _piece_table(lengths, tracks, self.radii), line)

    def _write(self, recording: Recording, result: _Result, folder: Path) -> list[Path]:
        output_folder("out", folder)
        files = [folder / name for name in ("modes.csv", "estimates.csv", "track.png")]
        write_table(files[0], result.pieces)
        write_table(
            files[1], _estimate_table(recording.times, recording.positions, result.tracks, self.radii)
        )
        figure = draw_track(recording.times, recording.positions, result.lengths, result.tracks, self.radii)
        with atomic_file(files[2]) as part:
            figure.savefig(part, format="png")
        return files

    def _check(self) -> None:
        self.check_files()
        if self.lengths and self.piece is not None:
            raise reject("piece", self.piece, "no value if lengths are given")
        for length in self.lengths:
            check_integer("lengths", length)
        if self.piece is not None:
            check_integer("piece", self.piece)
        distinct_radii("radii", self.radii)
        check_positive("process_variance", self.process_variance, allow_zero=True)
        if self.measurement_variance is not None:
            check_positive("measurement_variance", self.measurement_variance)
        sprt_thresholds(self.alpha, self.beta)
        check_choice("undecided", self.undecided, ("keep", "likeliest"))
        if self.start is not None:
            check_array("start", self.start, (4,))

    def _lengths(self, rows: int, path: Path) -> list[int]:
        if rows * (2 * len(self.radii) + 1) > MAX_RATIOS:
            raise reject("radii", self.radii, f"fewer radii for {rows:,} rows, or a part of the recording")
        if not self.lengths:
            piece = self.piece or DEFAULT_PIECE
            if rows > piece * MAX_PIECES:
                raise reject("piece", piece, f"at most {MAX_PIECES:,} pieces, for {rows:,} rows")
            return [min(piece, rows - first) for first in range(0, rows, piece)]
        if sum(self.lengths) != rows:
            raise reject(
                "lengths",
                self.lengths,
                f"lengths whose sum is {rows}, the number of rows of {path}, not {sum(self.lengths)}",
            )
        return list(self.lengths)


def _check_uniform(recording: Recording, path: Path) -> None:
    """Check that ATE can track a recording: no gaps, no missing rows, uniform ticks."""
    steps = np.diff(recording.times)
    uneven = np.abs(steps - recording.tick).max() > STEP_TOLERANCE * recording.tick
    if uneven or not recording.measured.all() or len(recording.pieces) > 1:
        raise ArgumentError(f"{path}: ATE needs uniform ticks with a measurement each")


def _piece_table(lengths: Sequence[int], tracks: ate.Tracks, radii: Sequence[float]) -> dict[str, list[Any]]:
    """Columns of modes.csv. Cells that do not apply are empty."""
    last = np.cumsum(lengths)
    first = last - np.asarray(lengths) + 1
    modes = tracks.decided.tolist()
    decisions = (first - 1 + tracks.ticks).tolist()
    undecided = tracks.undecided.tolist()
    return {
        "piece": list(range(1, len(modes) + 1)),
        "first_tick": first.tolist(),
        "last_tick": last.tolist(),
        "mode": [mode_name(mode, radii) for mode in modes],
        "mode_index": modes,
        "radius": [radii[(mode - 1) % len(radii)] if mode else "" for mode in modes],
        "decision_tick": [
            "" if missing else tick for tick, missing in zip(decisions, undecided, strict=True)
        ],
        "undecided": undecided,
    }


def _estimate_table(
    times: NDArray[np.float64],
    measurements: NDArray[np.float64],
    tracks: ate.Tracks,
    radii: Sequence[float],
) -> dict[str, Column]:
    """Columns of estimates.csv. The first three are in the format of a recording."""
    names = [mode_name(mode, radii) for mode in range(2 * len(radii) + 1)]
    estimates = {f"estimate_{name}": tracks.estimates[:, k] for k, name in enumerate(("x", "vx", "y", "vy"))}
    return {
        "t": times,
        "x": measurements[:, 0],
        "y": measurements[:, 1],
        **estimates,
        "mode": [names[mode] for mode in tracks.modes.tolist()],
        "mode_index": tracks.modes,
    }


def _printed_table(pieces: dict[str, list[Any]], times: NDArray[np.float64], tau: float) -> Table:
    table = Table()
    for name in ("piece", "ticks", "from\n[s]", "mode", "decided\nat tick", "delay\n[ticks]", "delay\n[s]"):
        table.add_column(escape(name), justify="left" if name == "mode" else "right")
    for k in range(min(len(pieces["piece"]), MAX_PRINTED_PIECES)):
        first, last, decision = (pieces[name][k] for name in ("first_tick", "last_tick", "decision_tick"))
        decided = ("undecided", "", "")
        if not pieces["undecided"][k]:
            ticks = decision - first + 1
            decided = (str(decision), str(ticks), f"{ticks * tau:.3f}")
        table.add_row(
            str(pieces["piece"][k]), f"{first}-{last}", f"{times[first - 1]:.3f}", pieces["mode"][k], *decided
        )
    return table
