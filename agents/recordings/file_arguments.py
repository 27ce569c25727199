"""Command-line flags that say how files of recordings are read and where the results go."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from agents.interface.help_texts import shown_default
from baselines.recordings.reading.names import ROLES
from hybrid_env.checks import ArgumentError, check_between, check_integer, check_positive, reject

if TYPE_CHECKING:
    from baselines.recordings.reading.read import RecordingFile

TAU_RANGE = (1e-9, 1e9)  # [s]
COLUMN_ROLES = ("t", *ROLES)


@dataclass(kw_only=True)
class FileArguments:
    """How files are read and where the results go."""

    files: Annotated[tyro.conf.Positional[tuple[Path, ...]], shown_default("none, at least one is needed")]
    """CSV, TSV, Parquet or GPX files, also compressed by gzip. Header, delimiter, decimal comma and index are
    found; columns are known by names such as time, timestamp, t, x, y, easting, northing, lat, lon."""
    columns: tuple[str, ...] = ()
    """Columns that the header does not tell, by name or number: time=3 x=1 y=2, or time=date lat=B lon=L."""
    object: str | None = None
    """Column that tells several objects apart; 'none' for a single one. By default columns such as id."""
    unit: str | None = None
    """Unit of x and y, for example m or km; 'deg' for longitude and latitude. By default from the header."""
    time_unit: str | None = None
    """Unit of the times: s, ms, us, ns, min, h, or a format such as '%d/%m/%Y %H:%M:%S'. By default
    ISO dates, seconds, and s, ms, us or ns since 1970 are recognised."""
    tau: float | None = None
    """Duration of a tick [s] of a file without times; by default time is counted in ticks."""
    gap: float | None = None
    """Longest time between two measurements [s]; after a longer gap the track starts anew. By default 20
    ticks."""
    out: Path | None = None
    """Output folder; by default <file name>_track in the folder of the file. With several files each has a
    folder of this name inside."""
    overwrite: bool = False
    """Replace existing results."""
    jobs: int | None = None
    """Files that are tracked at the same time. By default one for each core if there are many files."""

    def read(self, path: Path) -> "RecordingFile":
        """Read a file.

        Raises:
            ArgumentError: the file is invalid, or its columns are unclear.
        """
        from baselines.recordings.reading.read import read_recordings  # pandas; other commands start faster

        return read_recordings(
            path, columns=self.column_names(), object_column=self.object, unit=self.unit,
            time_unit=self.time_unit, tau=self.tau, gap=self.gap,
        )  # fmt: skip

    def column_names(self) -> dict[str, str]:
        """Return the columns by role.

        Raises:
            ArgumentError: an element is not of the form role=column, or a role is given twice.
        """
        names: dict[str, str] = {}
        for text in self.columns:
            role, sign, column = text.partition("=")
            if not sign or role not in COLUMN_ROLES or not column:
                raise reject("columns", text, f"role=column with a role of {', '.join(COLUMN_ROLES)}")
            if role in names:
                raise reject("columns", text, f"one column for {role}")
            names[role] = column
        return names

    def folders(self) -> list[Path]:
        """Return the output folder of each file.

        Raises:
            ArgumentError: two files have the same one.
        """
        folders = [self._folder(Path(path)) for path in self.files]
        first: dict[Path, Path] = {}
        for path, folder in zip(self.files, folders, strict=True):
            if folder.resolve() in first:
                other = first[folder.resolve()]
                raise ArgumentError(
                    f"{other} and {path} both have the output folder {folder}: rename one, or track each by "
                    "itself with --out"
                )
            first[folder.resolve()] = Path(path)
        return folders

    def check_files(self) -> None:
        """Check all arguments before any work.

        Raises:
            ArgumentError: one is not allowed.
        """
        if not self.files:
            raise reject("files", self.files, "at least one file")
        self.column_names()
        if self.tau is not None:
            check_between("tau", self.tau, *TAU_RANGE)
        if self.gap is not None:
            check_positive("gap", self.gap)
        if self.unit is not None and not self.unit.strip():
            raise reject("unit", self.unit, "the name of a unit, for example m, km or deg")
        if self.jobs is not None:
            check_integer("jobs", self.jobs)

    def _folder(self, path: Path) -> Path:
        name = f"{Path(path.name.removesuffix('.gz')).stem}_track"
        if self.out is None:
            return path.with_name(name)
        return self.out if len(self.files) == 1 else self.out / name


def object_folders(folder: Path, names: Sequence[str]) -> list[Path]:
    """Return the output folder of each object of a file: that of the file if it has only one."""
    if len(names) == 1:
        return [folder]
    found: list[Path] = []
    for number, name in enumerate(names, start=1):
        plain = "".join(letter if letter.isalnum() or letter in "._-+" else "_" for letter in name)
        plain = plain.strip(".") or str(number)
        path = folder / plain
        found.append(path if path not in found else folder / f"{plain}_{number}")
    return found
