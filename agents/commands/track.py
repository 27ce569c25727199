"""The command `hybridtrack track`: mode decisions on recordings of positions, one file or many."""

import functools
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import joblib
import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import filled_table
from agents.interface.help_texts import shown_default
from agents.interface.output_files import atomic_folder, output_folder, write_files
from agents.interface.parallel import Workers
from agents.interface.progress import print_lines, progress_display
from agents.interface.world_arguments import TrustArguments
from agents.recordings.figure import check_plotly, draw_recording, write_map
from agents.recordings.tables import piece_table, row_table
from agents.recordings.tracking import TrackedRecording, TrackingArguments
from baselines.recordings.reading.names import ROLES, columns_by_role
from hybrid_env.checks import ArgumentError, Count, Positive, reject
from hybrid_env.limits import TickLength
from hybrid_env.sensors import Radar, parse_sensors

if TYPE_CHECKING:
    from baselines.recordings.reading.read import RecordingFile


Report: TypeAlias = tuple[list[str], list[Table], list[Path]]
"""What was read and found of a file, in lines; for a single one also its pieces and new files."""


@dataclass(kw_only=True)
class Track(TrackingArguments, TrustArguments):
    """Decide between straight motion, left and right turns on recordings, and estimate the
    trajectory.

    Writes modes.csv, estimates.csv and track.png. Rows are counted from 1. What is not given, such
    as noise and turn radii, is found from the recording; lengths and times may have any unit.
    """

    files: Annotated[
        tyro.conf.Positional[tuple[Path, ...]], shown_default("none, at least one is needed")
    ]
    """CSV, TSV, Parquet, GPX or IGC files, also compressed by gzip. Header, delimiter, decimal
    comma and index are found; columns are known by names such as time, timestamp, t, x, y, easting,
    lat, lon.
    """
    columns: tuple[str, ...] = ()
    """Columns that the header does not tell, by name or number: time=3 x=1 y=2, or time=date
    lat=B lon=L.
    """
    object: str | None = None
    """Column that tells several objects apart; 'none' for a single one. By default columns such
    as id.
    """
    unit: str | None = None
    """Unit of x and y, for example m or km; 'deg' for longitude and latitude. By default from
    the header.
    """
    time_unit: str | None = None
    """Unit of the times: s, ms, us, ns, min, h, or a format such as '%d/%m/%Y %H:%M:%S'. By default
    ISO dates, seconds, and s, ms, us or ns since 1970 are recognised."""
    tau: TickLength | None = None
    """Duration of a tick [s] of a file without times; by default time is counted in ticks."""
    gap: Positive | None = None
    """Longest time between two measurements [s]; after a longer gap the track starts anew. By
    default 20 ticks.
    """
    radar: str | None = None
    """Radar that measured columns range and bearing: their standard deviations [unit of the range,
    rad], that of the range rate if there is a column of it, and the place, as in '30 0.01 rate 0.5
    at 1000 200'. Bearings are degrees clockwise from north, or in a column 'bearing [rad]' radians
    counter-clockwise from the x axis.
    """
    out: Path | None = None
    """Output folder; by default <file name>_track in the folder of the file. With several files
    each has a folder of this name inside.
    """
    overwrite: bool = False
    """Replace existing results."""
    jobs: Count | None = None
    """Files that are tracked at the same time. By default one for each core if there are many
    files.
    """
    picture: bool | None = None
    """Write track.png; by default with up to 20 files."""
    html: bool = False
    """Write track.html, a map in which time, mode and probability can be read. Needs the extra
    'html'.
    """

    def run(self) -> None:
        """Track the recordings, write the results and print the decisions."""
        self.check_files()
        self.check_tracking()
        if self.html:
            check_plotly()
        # Up to this many files, each has a picture by default; it takes longer than the tracking.
        picture = len(self.files) <= 20 if self.picture is None else self.picture
        # It is sent to a process with every file.
        work = replace(self, files=(), picture=picture)
        work_on_files(work.track_file, self.files, self.folders(), self.jobs)

    def track_file(self, path: Path, folder: Path) -> Report:
        """Track the recordings of a file, and then write; several objects have folders of their
        own inside.
        """
        check_free(folder, self.overwrite)
        file = self.read(path)
        results = [self.track(recording) for recording in file.recordings]
        lines = [file.summary]
        tables = []
        files = []
        folders = object_folders(folder, [recording.name for recording in file.recordings])
        with atomic_folder("out", folder) as part:
            for tracked, place in zip(results, folders, strict=True):
                pieces = piece_table(tracked)
                lines += report_lines(tracked)
                tables.append(_printed_table(pieces, tracked))
                inside = place.relative_to(folder)
                files += [place / name for name in self._write(tracked, pieces, part / inside)]
        return lines, tables if len(tables) == 1 else [], files

    def _write(
        self,
        tracked: TrackedRecording,
        pieces: dict[str, list[Any]],
        folder: Path,
    ) -> list[str]:
        """Write the results of an object; return the names of the files."""
        import pandas as pd

        output_folder("out", folder)
        for name, columns in (("modes.csv", pieces), ("estimates.csv", row_table(tracked))):
            table = pd.DataFrame(columns)
            table.to_csv(folder / name, index=False, na_rep="nan", lineterminator="\n")
        if self.picture:
            write_files(folder, {"track.png": draw_recording(tracked)})
        if self.html:
            write_map(folder / "track.html", tracked)
        return [
            "modes.csv",
            "estimates.csv",
            *["track.png"] * bool(self.picture),
            *["track.html"] * self.html,
        ]

    def read(self, path: Path) -> "RecordingFile":
        """Read a file."""
        # Pandas; other commands start faster.
        from baselines.recordings.reading.read import read_recordings

        return read_recordings(
            path,
            columns=self.column_names(),
            object_column=self.object,
            unit=self.unit,
            time_unit=self.time_unit,
            tau=self.tau,
            gap=self.gap,
            radar=self.parsed_radar(),
        )

    def parsed_radar(self) -> Radar | None:
        """Return the radar, if there is one."""
        if self.radar is None:
            return None
        with suppress(ArgumentError):
            (radar,) = parse_sensors([f"radar {self.radar}"])
            if isinstance(radar, Radar):
                return radar
        allowed = (
            "two standard deviations, rate and place, as in '30 0.01 rate 0.5 at 10 0', without"
            " period and range"
        )
        raise reject("radar", self.radar, allowed)

    def column_names(self) -> dict[str, str]:
        """Return the columns by role."""
        return columns_by_role(self.columns, ("t", *ROLES))

    def folders(self) -> list[Path]:
        """Return the output folder of each file."""
        folders = [self._folder(Path(path)) for path in self.files]
        first: dict[Path, Path] = {}
        for path, folder in zip(self.files, folders, strict=True):
            if folder.resolve() in first:
                both = f"{first[folder.resolve()]} and {path} both have the output folder {folder}"
                raise ArgumentError(f"{both}: rename one, or track each by itself with --out")
            first[folder.resolve()] = path
        return folders

    def check_files(self) -> None:
        """Check all arguments before any work."""
        if not self.files:
            raise reject("files", self.files, "at least one file")
        self.column_names()
        self.parsed_radar()

    def _folder(self, path: Path) -> Path:
        # . and /.
        if not path.name:
            raise reject("files", str(path), "files, not a folder")
        name = f"{Path(path.name.removesuffix('.gz')).stem}_track"
        if self.out is None:
            return path.with_name(name)
        return self.out if len(self.files) == 1 else self.out / name


def report_lines(tracked: TrackedRecording) -> list[str]:
    """Return what was found, in one line, and a line for each warning."""
    model, recording = tracked.model, tracked.recording
    name, unit, time = recording.name, recording.unit, recording.time_unit
    radii = ", ".join(
        f"{radius:.4g} {unit} ({np.degrees(rate):.3g} deg/{time})"
        for radius, rate in zip(model.radii, model.turn_rates, strict=True)
    )
    radii_are, variance_is, process_is, duration_is = (
        "found" if of in model.estimated else "given"
        for of in ("radii", "measurement_variance", "process_variance", "duration")
    )
    lines = [
        f"{name}: {len(tracked.pieces)} pieces by {tracked.decider}; turn radii {radii}"
        f" {radii_are}, R {model.measurement_variance:.4g} {unit}^2 {variance_is}, Q"
        f" {model.process_variance:.3g} {unit}^2/{time}^2 {process_is}, mean duration"
        f" {model.duration:.3g} ticks {duration_is}, tick {tracked.tau:.6g} {time}"
    ]
    remarks = {
        "no turns are seen; the radius has no meaning": (
            not model.turns and "radii" in model.estimated
        ),
        f"{tracked.shared} rows share a tick with another one: their mean is used": tracked.shared,
        f"{tracked.outliers} measurements far from their neighbours are not used": tracked.outliers,
        f"irregular times: rows are moved to ticks by {tracked.moved:.0%} of one (rms)": (
            tracked.moved > 0.01
        ),
    }
    lines += [f"{name}: {text}" for text, true in remarks.items() if true]
    return lines + [f"{name}: warning: {text}" for text in tracked.warnings]


def _printed_table(pieces: dict[str, list[Any]], tracked: TrackedRecording) -> Table:
    max_printed_pieces = 20
    unit = escape(f"[{tracked.recording.time_unit}]")
    rows = []
    columns = [column[:max_printed_pieces] for column in pieces.values()]
    for number, first, last, begin, _, mode, radius, when, _ in zip(*columns, strict=True):
        known = "" if radius == "" else f"{radius:.4g}"
        decided = "undecided" if when == "" else f"{when:.6g}"
        rows.append((str(number), f"{first}-{last}", f"{begin:.6g}", mode, known, decided))
    more = len(pieces["piece"]) - max_printed_pieces
    heads = ("piece", "rows", f"from\n{unit}", "mode", "radius", f"decided at\n{unit}")
    return filled_table(
        "Pieces",
        heads,
        rows,
        f"... and {more} more in modes.csv" if more > 0 else "",
        0,
    )


def object_folders(folder: Path, names: Sequence[str]) -> list[Path]:
    """Return the output folder of each object of a file: that of the file if it has only one."""
    if len(names) == 1:
        return [folder]
    folders: dict[str, Path] = {}
    for number, name in enumerate(names, start=1):
        plain = "".join(letter if letter.isalnum() or letter in "._-+" else "_" for letter in name)
        plain = plain.strip(".") or str(number)
        # Names may differ in letters that folders do not tell apart.
        while plain.casefold() in folders:
            plain = f"{plain}_{number}"
        folders[plain.casefold()] = folder / plain
    return list(folders.values())


# On a file and its output folder; it can be pickled.
Work = Callable[[Path, Path], Report]


def work_on_files(
    work: Work,
    paths: Sequence[Path],
    folders: Sequence[Path],
    jobs: Count | None = None,
) -> None:
    """Work on files in processes and print a report for each, or on the standard error output
    why there is none.
    """
    console = Console(emoji=False)
    errors = Console(stderr=True, emoji=False)
    failed = 0
    if len(paths) == 1:
        with console.status("Tracking"):
            lines, tables, files = work(paths[0], folders[0])
        print_lines(console, *lines)
        for table in tables:
            console.print(table)
        print_lines(console, *files)
        return
    with progress_display(console, transient=True) as progress:
        task = progress.add_task("Tracking", total=len(paths), note="")
        calls = {
            file: functools.partial(_attempt, work, *file)
            for file in zip(paths, folders, strict=True)
        }
        # With fewer files the start of processes takes longer than it saves.
        usual = joblib.cpu_count() if len(paths) >= 8 else 1
        for _, result in Workers(min(jobs or usual, len(paths))).results(calls):
            if isinstance(result, str):
                failed += 1
                print_lines(errors, f"hybridtrack: {result}")
            else:
                print_lines(progress.console, *result[0])
            progress.update(task, advance=1, note=f"{failed} failed" if failed else "")
    if failed:
        verb = "is" if failed == 1 else "are"
        raise ArgumentError(
            f"{failed:,} of {len(paths):,} files {verb} not tracked; the others are"
        )


def check_free(folder: Path, overwrite: bool) -> None:
    """Check before any work that the folder can be written to, and is empty unless it may be
    overwritten.
    """
    try:
        full = folder.is_dir() and any(folder.iterdir())
        existing = next((place for place in (folder, *folder.parents) if place.exists()), folder)
        writable = existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)
    except (OSError, ValueError):
        full = writable = False
    if full and not overwrite:
        raise reject("out", str(folder), "a new or empty folder, or --overwrite")
    if not writable:
        raise reject("out", str(folder), "a writable folder")


def _attempt(work: Work, path: Path, folder: Path) -> Report | str:
    try:
        return work(path, folder)
    except ArgumentError as error:
        return str(error)
    except OSError as error:
        return f"{path}: {error.strerror or error}"
