"""The command `hybridtrack track`: mode decisions on recordings of positions, one file or many."""

import functools
import importlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import joblib
import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import counted, filled_table
from agents.interface.help_texts import shown_default
from agents.interface.output_files import atomic_folder, write_json
from agents.interface.parallel import Workers
from agents.interface.progress import print_lines, progress_display
from agents.interface.world_arguments import TrustArguments
from agents.recordings.tracked_recording import TrackedRecording
from agents.recordings.tracking import TrackingArguments
from baselines.recordings.reading.names import GIVEN_ROLES, ROW_FILES, columns_by_role
from hybrid_env.checks import ArgumentError, Count, Positive, reject
from hybrid_env.extras import explained
from hybrid_env.limits import Quantity
from hybrid_env.sensors import parse_sensors

# Number of rows of a table that are written at a time.
ROWS = 100_000

FileReport: TypeAlias = tuple[list[str], list[Table], str]
"""What was read and found of a file, in lines; for a single one also its pieces and where the
results are.
"""


@dataclass(kw_only=True)
class Track(TrackingArguments, TrustArguments):
    """Decide between straight motion, left and right turns on recordings, and estimate the
    trajectory.

    Writes modes.csv, estimates.csv, track.json and track.png. Rows are counted from 1. What is not
    given, such as noise and turn radii, is found from the recording; lengths and times may have any
    unit.
    """

    files: Annotated[
        tyro.conf.Positional[tuple[Path, ...]], shown_default("none, at least one is needed")
    ]
    """CSV, TSV, Parquet, GPX, TCX, KML, GeoJSON, NMEA, AIS or IGC files, also compressed by gzip.
    Header, delimiter, decimal comma and index are found; columns are known by names such as time,
    timestamp, t, x, y, easting, lat, lon.
    """
    columns: tuple[str, ...] = ()
    """Columns that the header does not tell, by name or number: time=3 x=1 y=2, or time=date
    lat=B lon=L; speed=none reads no such column.
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
    """Unit of the times: s, ms, us, ns, min, h, d, or a format such as '%d/%m/%Y %H:%M:%S'. By
    default dates, times of day, seconds, and s, ms, us or ns since 1970 are recognised."""
    tau: Quantity | None = None
    """Duration of a tick [s] of a file without times; by default time is counted in ticks."""
    thousands: str | None = None
    """Mark between thousands in the numbers of the file, such as ','."""
    frame: Literal["enu", "ned", "image", "ecef"] | None = None
    """Where x and y point: enu east and north, ned north and east, image right and down, ecef with
    z from the centre of the earth. By default from the header, otherwise enu.
    """
    bad_rows: Literal["skip", "refuse"] = "skip"
    """What becomes of rows that are no measurement: they are left out and counted, or the file is
    refused."""
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
    png: bool | None = None
    """Write track.png; by default with up to 20 files."""
    parquet: bool = False
    """Write estimates.parquet in place of estimates.csv."""
    html: bool = False
    """Write track.html, a map in which time, mode and probability can be read. Needs the extra
    'html'.
    """
    geojson: bool = False
    """Write track.geojson with the estimated line of each piece. Needs latitude and longitude."""
    gpx: bool = False
    """Write track.gpx, a track of the estimates with a segment for each piece. Needs latitude and
    longitude.
    """

    def run(self) -> None:
        """Track the recordings, write the results and print the decisions."""
        if not self.files:
            raise reject("files", self.files, "at least one file")
        self.check_tracking()
        self.reading_options()
        with explained():
            # Before anything is tracked.
            importlib.import_module("pyarrow")
        if self.html:
            from agents.recordings.maps import check_plotly

            check_plotly()
        # Up to this many files, each has a picture by default; it takes longer than the tracking.
        png = len(self.files) <= 20 if self.png is None else self.png
        # The work is sent to a process with every file.
        work = replace(self, files=(), png=png)
        work_on_files(work.track_file, self.files, self.folders(), self.jobs)

    def track_file(self, path: Path, folder: Path) -> FileReport:
        """Track the recordings of a file, and then write; several objects have folders of their
        own inside.
        """
        if not self.overwrite and folder.is_dir() and any(folder.iterdir()):
            raise reject("out", str(folder), "a new or empty folder, or --overwrite")
        # Pandas; other commands start faster.
        import pyarrow as pa

        from baselines.recordings.reading.read import read_recordings

        file = read_recordings(path, **self.reading_options())
        # The texts of a large file, which are numbers now, take a tenth of what its rows need.
        pa.default_memory_pool().release_unused()
        for name in ("geojson", "gpx"):
            if getattr(self, name) and file.recordings[0].projection is None:
                raise ArgumentError(f"{path}: --{name} needs latitude and longitude, not x and y")
        several = len(file.recordings) > 1
        results, refused = [], []
        for recording in file.recordings:
            try:
                results.append(self.track(recording))
            except ArgumentError as error:
                refused.append(f"{recording.name}: {error}" if several else str(error))
        if not results:
            raise ArgumentError(f"{path}: {refused[0]}")
        with atomic_folder(folder) as part:
            places = object_folders(part, [tracked.recording.name for tracked in results])
            for tracked, place in zip(results, places, strict=True):
                self._write(tracked, place)
            written = ", ".join(sorted(path.name for path in places[0].iterdir()))
        for place in places:
            # The rows of results that are overwritten may have the other format.
            (folder / place.relative_to(part) / ROW_FILES[not self.parquet]).unlink(missing_ok=True)
        warnings = [warning.removeprefix(f"{path}: ") for warning in (*file.warnings, *refused)]
        if len(results) < file.objects:
            missing = file.objects - len(results)
            warnings.append(f"{missing:,} of {counted(file.objects, 'object')} not tracked")
        lines = [file.summary, *map("  warning: {}".format, warnings)]
        for tracked in results:
            first, *remarks = report_lines(tracked)
            named = f"{tracked.recording.name}: " * (file.objects > 1)
            lines.append(f"  {named}{first}")
            lines += [f"    {remark}" for remark in remarks]
        tables = [_printed_table(tracked) for tracked in results if len(results) == 1]
        each = "a folder for each object with " * (len(results) > 1)
        return lines, tables, f"Results in {folder}: {each}{written}"

    def _write(self, tracked: TrackedRecording, folder: Path) -> None:
        """Write the results of an object."""
        import pandas as pd

        folder.mkdir(exist_ok=True)
        # A spreadsheet would calculate a name such as =1+1.
        name = re.sub(r"^(?=[=+\-@|])", "'", tracked.recording.name)
        pieces = pd.DataFrame(tracked.piece_table() | {"object": name})
        pieces.to_csv(folder / "modes.csv", index=False, na_rep="nan", lineterminator="\n")
        rows = tracked.row_table()
        rows["object"] = [name] * len(rows["object"])
        write_table(folder / ROW_FILES[self.parquet], rows)
        if tracked.vertical is not None:
            climbs = pd.DataFrame(tracked.climb_table() | {"object": name})
            climbs.to_csv(folder / "climbs.csv", index=False, na_rep="nan", lineterminator="\n")
        write_json(folder / "track.json", tracked.settings())
        if self.png:
            # Matplotlib; other commands start faster.
            from agents.recordings.figure import draw_recording

            draw_recording(tracked).savefig(folder / "track.png")
        if self.html or self.geojson or self.gpx:
            from agents.recordings import maps

            if self.html:
                maps.map_figure(tracked).write_html(folder / "track.html")
            if self.geojson:
                text = json.dumps(maps.geojson(tracked), allow_nan=False)
                (folder / "track.geojson").write_text(text, encoding="utf-8")
            if self.gpx:
                (folder / "track.gpx").write_text(maps.gpx_text(tracked), encoding="utf-8")

    def reading_options(self) -> dict[str, Any]:
        """Return the arguments of `read_recordings`."""
        radar = None
        if self.radar is not None:
            (radar,) = parse_sensors([f"radar {self.radar}"], "radar")
            if not radar.places:
                raise reject("radar", self.radar, "standard deviations of range and bearing")
        return {
            "columns": columns_by_role(self.columns, ("t", *GIVEN_ROLES)),
            "object_column": self.object,
            "unit": self.unit,
            "time_unit": self.time_unit,
            "tau": self.tau,
            "gap": self.gap,
            "radar": radar,
            "thousands": self.thousands,
            "frame": self.frame,
            "bad_rows": self.bad_rows,
        }

    def folders(self) -> list[Path]:
        """Return the output folder of each file."""
        names = [f"{Path(path.name.removesuffix('.gz')).stem}_track" for path in self.files]
        if self.out is not None and len(names) == 1:
            return [self.out]
        parents = (path.parent if self.out is None else self.out for path in self.files)
        folders = [parent / name for parent, name in zip(parents, names, strict=True)]
        if len({folder.resolve() for folder in folders}) < len(folders):
            shown = ", ".join(map(str, folders))
            raise reject("files", shown, "files with output folders of different names")
        return folders


def write_table(path: Path, columns: Mapping[str, Any]) -> None:
    """Write a table of n rows as Parquet, or as CSV to a path that ends so. columns: (n,) values of
    each by its name; a text that is empty is a cell without a value.
    """
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet

    csv = path.suffix == ".csv"

    def part(first: int) -> Any:
        table = {}
        for name, column in columns.items():
            values = np.asarray(column[first : first + ROWS])
            # Arrow would write true and false.
            if values.dtype == object or (csv and values.dtype == bool):
                values = values.astype(str)
            table[name] = pa.array(values, mask=values == "" if values.dtype.kind == "U" else None)
        return pa.table(table)

    kind = pyarrow.csv.CSVWriter if csv else pyarrow.parquet.ParquetWriter
    with kind(path, part(0).schema) as writer:
        for first in range(0, len(columns["t"]), ROWS):
            writer.write_table(part(first))


def report_lines(tracked: TrackedRecording) -> list[str]:
    """Return what was decided and found, in one line, and a line for each remark and warning."""
    model, recording, grid = tracked.model, tracked.recording, tracked.grid
    unit, time = recording.unit, recording.time_unit
    radii = ", ".join(
        f"{radius:.4g} {unit} ({np.degrees(rate):.3g} deg/{time})"
        for radius, rate in zip(model.radii, model.turn_rates, strict=True)
    )
    values = {
        "radii": f"{'radius' if len(model.radii) == 1 else 'radii'} {radii}",
        "measurement_variance": f"R {model.measurement_variance:.4g} {unit}^2",
        "process_variance": f"Q {model.process_variance:.3g} {unit}^2/{time}^2",
        "drift_variance": f"drift {model.drift_variance:.3g} {unit}^2 a tick",
        "velocity_variance": f"velocities to {np.sqrt(model.velocity_variance):.3g} {unit}/{time}",
        "duration": f"mean duration {model.duration:.3g} ticks",
        "modes": f"modes {', '.join(tracked.mode_names())}",
    }
    for name in ("drift_variance", "velocity_variance"):
        if not getattr(model, name):
            del values[name]
    if not model.modes:
        del values["modes"]
    elif not model.radii:
        del values["radii"]
    parts = [
        counted(len(tracked.pieces), "piece") + (f" by {tracked.decider}" if tracked.live else ""),
        f"tick {model.tau:.6g} {time}",
    ]
    found = [text for name, text in values.items() if name in model.estimated]
    given = [text for text in values.values() if text not in found]
    parts += [f"{word}: {', '.join(of)}" for word, of in (("found", found), ("given", given)) if of]
    unused = {
        "far from their neighbours": tracked.outliers,
        "while the object stands still": tracked.standing,
        "on the tick of another one": grid.shared,
    }
    causes = ", ".join(f"{count:,} {cause}" for cause, count in unused.items() if count)
    remarks = {
        "no turns are seen; the radius has no meaning": (
            not model.turns and "radii" in model.estimated
        ),
        f"measurements that are not used: {causes}": causes,
        f"irregular times: rows are moved to ticks by {grid.moved:.0%} of one (rms)": (
            grid.moved > 0.01
        ),
    }
    if tracked.wind.any():
        vx, vy = tracked.wind
        drifts = f"circles drift by ({vx:.3g}, {vy:.3g}) {unit}/{time}, as in a wind or a current:"
        remarks[f"{drifts} radii and speeds are those without it"] = True
    if tracked.vertical is not None:
        words, rates = tracked.vertical.words(), tracked.vertical.of_pieces[:, 0]
        counts = ", ".join(
            f"{counted(words.count(word), word)} at {np.median(rates[np.array(words) == word]):.3g}"
            for word in ("climb", "descend", "level")
            if word in words
        )
        remarks[f"altitude: {counts} {unit}/{time}"] = bool(words)
    lines = ["; ".join(parts), *(text for text, true in remarks.items() if true)]
    return [*lines, *map("warning: {}".format, tracked.warnings)]


def _printed_table(tracked: TrackedRecording) -> Table:
    """Return the first pieces, with known switches also when their modes were decided."""
    most = 20
    table = tracked.piece_table()
    columns = {
        "piece": map(str, table["piece"]),
        "rows": map("{}-{}".format, table["first_row"], table["last_row"]),
        "from": map(_shown, table.get("begin_time", table["begin"])),
        "mode": table["mode"].tolist(),
        "radius": map(_shown, table["radius"]),
    }
    if tracked.live and tracked.known_switches:
        decided = map(_shown, table.get("decided_time", table["decided_at"]))
        columns["decided at"] = [text or "undecided" for text in decided]
    rows = list(zip(*columns.values(), strict=True))
    more = len(rows) - most
    caption = f"... and {more:,} more in modes.csv" if more > 0 else ""
    unit = "" if tracked.recording.epoch else f", times in {tracked.recording.time_unit}"
    return filled_table(f"Pieces{unit}", list(columns), rows[:most], caption, 0)


def _shown(cell: Any) -> str:
    return f"{cell:.6g}" if isinstance(cell, float) else escape(str(cell))


def object_folders(folder: Path, names: Sequence[str]) -> list[Path]:
    """Return the output folder of each object of a file: that of the file if it has only one."""
    if len(names) == 1:
        return [folder]
    folders: dict[str, Path] = {}
    for number, name in enumerate(names, start=1):
        plain = re.sub(r"[^\w.+-]", "_", name).strip(".") or str(number)
        # Names may differ in letters that folders do not tell apart.
        while plain.casefold() in folders:
            plain = f"{plain}_{number}"
        folders[plain.casefold()] = folder / plain
    return list(folders.values())


def work_on_files(
    work: Callable[[Path, Path], FileReport],
    paths: Sequence[Path],
    folders: Sequence[Path],
    jobs: Count | None = None,
) -> None:
    """Work on files with their output folders, many at the same time, and print a report for each,
    or on the standard error output why there is none. It is sent to processes.
    """
    console = Console(emoji=False)
    errors = Console(stderr=True, emoji=False)
    if len(paths) == 1:
        with console.status("Tracking"):
            lines, tables, results = work(paths[0], folders[0])
        print_lines(console, *lines)
        for table in tables:
            console.print(table)
        print_lines(console, results)
        return
    failed = 0
    calls = {
        file: functools.partial(_attempt, work, *file) for file in zip(paths, folders, strict=True)
    }
    # With fewer files the start of processes takes longer than it saves.
    usual = joblib.cpu_count() if len(paths) >= 8 else 1
    with progress_display(console, transient=True) as progress:
        task = progress.add_task("Tracking", total=len(paths), note="")
        for _, result in Workers(jobs=min(jobs or usual, len(paths))).results(calls):
            if isinstance(result, str):
                failed += 1
                print_lines(errors, f"hybridtrack: {result}")
            else:
                print_lines(progress.console, *result[0])
            progress.update(task, advance=1, note=f"{failed} failed" if failed else "")
    if failed == len(paths):
        raise ArgumentError(f"none of the {len(paths):,} files could be tracked")
    parents = {folder.parent for folder in folders}
    parent = parents.pop() / "*_track" if len(parents) == 1 else "*_track beside each file"
    print_lines(console, f"Results in {parent}")
    if failed:
        raise ArgumentError(f"{failed:,} of {len(paths):,} files could not be tracked")


def _attempt(
    work: Callable[[Path, Path], FileReport], path: Path, folder: Path
) -> FileReport | str:
    """Return the report on a file, or why there is none."""
    try:
        return work(path, folder)
    except ArgumentError as error:
        return str(error)
    except OSError as error:
        return f"{path}: {error.strerror or error}"
