"""The command `hybridtrack track`: mode decisions on recordings of positions."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from agents.interface.output_files import atomic_folder, output_folder, write_files, write_table
from agents.interface.trust import TrustArguments
from agents.recordings.files import FileArguments, Report, check_free, object_folders, work_on_files
from agents.recordings.tracked import TrackedRecording, piece_table, row_table
from agents.recordings.tracking import TrackingArguments

MAX_PRINTED_PIECES = 20
FEW_FILES = 20  # up to this many files, each has a picture by default; it takes longer than the tracking


@dataclass(kw_only=True)
class Track(TrackingArguments, TrustArguments, FileArguments):
    """Decide between straight motion, left and right turns on recordings, and estimate the trajectory.

    Writes modes.csv, estimates.csv and track.png. Rows are counted from 1. What is not given, such as noise
    and turn radii, is found from the recording; lengths and times may have any unit. Of a glider's flight log
    (IGC), without further flags, it writes the circles instead: circles.csv and track.png.
    """

    picture: bool | None = None
    """Write track.png; by default with up to 20 files."""
    html: bool = False
    """Write track.html, a map in which time, mode and probability can be read. Needs the extra 'html'."""

    def run(self) -> None:
        """Track the recordings, write the results and print the decisions."""
        self.check_files()
        self.check_tracking()
        if self.html:
            from agents.recordings.figure import check_plotly

            check_plotly()
        picture = len(self.files) <= FEW_FILES if self.picture is None else self.picture
        work = replace(self, files=(), picture=picture)  # it is sent to a process with every file
        work_on_files(work.track_file, self.files, self.folders(), self.jobs)

    def track_file(self, path: Path, folder: Path) -> Report:
        """Track the recordings of a file, and then write; several objects have folders of their own inside."""
        check_free(folder, self.overwrite)
        given = {one.name for one in fields(self) if getattr(self, one.name) != one.default}
        if not given - {"files", "out", "overwrite", "jobs", "picture"}:
            from agents.recordings.gliders import track_glider
            from baselines.recordings.reading.files import read_igc

            log = read_igc(path)
            if log is not None:
                return track_glider(path.name, log, folder, bool(self.picture))
        found = self.read(path)
        results = [self.track(recording) for recording in found.recordings]
        lines, tables, files = [found.summary], [], []
        folders = object_folders(folder, [recording.name for recording in found.recordings])
        with atomic_folder("out", folder) as part:
            for tracked, place in zip(results, folders, strict=True):
                pieces = piece_table(tracked)
                lines += report_lines(tracked)
                tables.append(_printed_table(pieces, tracked))
                inside = place.relative_to(folder)
                files += [place / name for name in self._write(tracked, pieces, part / inside)]
        return Report(tuple(lines), tables[0] if len(tables) == 1 else None, tuple(files))

    def _write(self, tracked: TrackedRecording, pieces: dict[str, list[Any]], folder: Path) -> list[str]:
        """Write the results of an object; return the names of the files."""
        from agents.recordings.figure import draw_recording, write_map  # Matplotlib loads slowly

        output_folder("out", folder)
        write_table(folder / "modes.csv", pieces)
        write_table(folder / "estimates.csv", row_table(tracked))
        if self.picture:
            write_files(folder, {"track.png": draw_recording(tracked)})
        if self.html:
            write_map(folder / "track.html", tracked)
        return ["modes.csv", "estimates.csv", *["track.png"] * bool(self.picture), *["track.html"] * self.html]


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
        f"{name}: {len(tracked.pieces)} pieces by {tracked.decider}; turn radii {radii} {radii_are}, R "
        f"{model.measurement_variance:.4g} {unit}^2 {variance_is}, Q {model.process_variance:.3g} "
        f"{unit}^2/{time}^2 {process_is}, mean duration {model.duration:.3g} ticks {duration_is}, tick "
        f"{tracked.tau:.6g} {time}"
    ]
    found = {
        "no turns are seen; the radius has no meaning": not model.turns and "radii" in model.estimated,
        f"{tracked.shared} rows share a tick with another one: their mean is used": tracked.shared,
        f"{tracked.outliers} measurements far from their neighbours are not used": tracked.outliers,
        f"irregular times: rows are moved to ticks by {tracked.moved:.0%} of one (rms)": tracked.moved > 0.01,
    }
    lines += [f"{name}: {text}" for text, true in found.items() if true]
    return lines + [f"{name}: warning: {text}" for text in tracked.warnings]


def _printed_table(pieces: dict[str, list[Any]], tracked: TrackedRecording) -> Table:
    unit = tracked.recording.time_unit
    table = Table()
    for name in ("piece", "rows", f"from\n[{unit}]", "mode", "radius", f"decided at\n[{unit}]"):
        table.add_column(escape(name), justify="left" if name == "mode" else "right")
    for k in range(min(len(pieces["piece"]), MAX_PRINTED_PIECES)):
        radius, when = pieces["radius"][k], pieces["decided_at"][k]
        table.add_row(
            str(pieces["piece"][k]), f"{pieces['first_row'][k]}-{pieces['last_row'][k]}", f"{pieces['begin'][k]:.6g}",
            pieces["mode"][k], f"{radius:.4g}" if radius != "" else "", f"{when:.6g}" if when != "" else "undecided",
        )  # fmt: skip
    if len(pieces["piece"]) > MAX_PRINTED_PIECES:
        table.caption = f"... and {len(pieces['piece']) - MAX_PRINTED_PIECES} more in modes.csv"
    return table
