"""The command `hybridtrack score`: statements of any origin beside the truth."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from agents.interface.help_texts import shown_default
from baselines.recordings.reading.names import SECONDS
from hybrid_env.checks import check_choice, reject

if TYPE_CHECKING:
    from baselines.scoring.score import TimelineScores


@dataclass(kw_only=True)
class Score:
    """Score statements of any origin and any modes: agreement, delay, misses, false changes an hour.

    Several files of statements are compared in pairs with the first one.
    """

    files: Annotated[tyro.conf.Positional[tuple[Path, ...]], shown_default("none, the truth and one more are needed")]
    """CSV, TSV or Parquet file of the true modes, then files of statements, each with columns of times and
    modes. Samples hold until the next one; the last time of the truth is the end of a track."""
    columns: tuple[str, ...] = ()
    """Columns that the headers do not tell, by name or number: time=1 mode=4."""
    object: str | None = None
    """Column that tells several tracks apart; 'none' for a single one. By default columns such as track."""
    time_unit: str | None = None
    """Unit of the times: s, ms, us, ns, min, h, or a format such as '%d/%m/%Y %H:%M:%S'. By default that of
    the header or seconds; dates are recognised."""
    per: str = "h"
    """Time in which false changes are counted: h, min or s."""
    normal: str | None = None
    """True mode, away from which a false change is a false alarm, counted in the time in which it is true."""
    out: Path | None = None
    """JSON file for figures, differences and intervals."""
    picture: Path | None = None
    """PNG file for the modes of the first tracks over time."""

    def run(self) -> None:
        """Score the statements, print the tables and write the files."""
        check_choice("per", self.per, ("h", "min", "s"))
        if len(self.files) < 2:
            raise reject("files", [str(file) for file in self.files], "the truth and at least one more file")
        for name in ("out", "picture"):
            path = getattr(self, name)
            if path is not None and not path.parent.is_dir():
                raise reject(name, str(path), "a file in a folder that exists")
        result = self.score()
        from rich.console import Console

        from agents.interface.output_files import save_figure, write_json
        from agents.interface.progress import print_lines
        from agents.studies.score_report import score_figure, score_tables

        console = Console(emoji=False)
        for table in score_tables(result, self.per):
            console.print(table)
        if self.out is not None:
            write_json(self.out, result.as_json())
        if self.picture is not None:
            save_figure(score_figure(result), self.picture)
        print_lines(console, *filter(None, (self.out, self.picture)))

    def score(self) -> "TimelineScores":
        """Read the files and score the statements."""
        from baselines.recordings.reading.modes import read_modes  # pandas; other commands start faster
        from baselines.scoring.score import score

        for text in self.columns:
            if text.partition("=")[0] not in ("time", "mode") or not text.partition("=")[2]:
                raise reject("columns", text, "time=column or mode=column")
        columns = dict(text.split("=", 1) for text in self.columns)
        names = [file.name.removesuffix(".gz").rpartition(".")[0] or file.name for file in self.files[1:]]
        if len(set(names)) < len(names):
            raise reject("files", names, "statements in files of different names")
        truth, *stated = (
            read_modes(file, columns=columns, object_column=self.object, time_unit=self.time_unit)
            for file in self.files
        )
        sets = {name: file.like(truth, name) for name, file in zip(names, stated, strict=True)}
        return score(
            list(truth.times.values()), list(truth.modes.values()),
            {name: list(file.modes.values()) for name, file in sets.items()},
            statement_times={name: list(file.times.values()) for name, file in sets.items()},
            per=SECONDS[self.per], normal=self.normal,
        )  # fmt: skip
