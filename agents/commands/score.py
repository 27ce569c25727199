"""The command `hybridtrack score`: statements of any origin beside the truth."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import counted, estimate_cell, filled_table
from agents.figures.canvas import legend_beside, new_canvas
from agents.figures.tracks import draw_timelines, legend_patches
from agents.interface.help_texts import shown_default
from agents.interface.output_files import save_figure, write_json
from agents.interface.progress import print_lines
from baselines.recordings.reading.names import SECONDS, columns_by_role
from baselines.scoring.score import TimelineScores, score
from hybrid_env.checks import IntArray, reject

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(kw_only=True)
class Score:
    """Score statements of any origin and any modes: agreement, delay, misses, false changes an
    hour.

    Several files of statements are compared in pairs with the first one.
    """

    files: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        shown_default("none, the truth and one more are needed"),
    ]
    """CSV, TSV or Parquet file of the true modes, then files of statements, each with columns of
    times and modes, or folders of results of hybridtrack track. Samples hold until the next one;
    the last time of the truth is the end of a track.
    """
    columns: tuple[str, ...] = ()
    """Columns that the headers do not tell, by name or number: time=1 mode=4."""
    object: str | None = None
    """Column that tells several tracks apart; 'none' for a single one. By default columns such
    as track.
    """
    time_unit: str | None = None
    """Unit of the times: s, ms, us, ns, min, h, d, or a format such as '%d/%m/%Y %H:%M:%S'. By
    default that of the header or seconds; dates are recognised.
    """
    per: Literal["h", "min", "s"] = "h"
    """Time in which false changes are counted."""
    normal: str | None = None
    """True mode, away from which a false change is a false alarm, counted in the time in which
    it is true.
    """
    out: Path | None = None
    """JSON file for figures, differences and intervals."""
    picture: Path | None = None
    """PNG file for the modes of the first tracks over time."""

    def run(self) -> None:
        """Score the statements, print the tables and write the files."""
        if len(self.files) < 2:
            files = ", ".join(map(str, self.files))
            raise reject("files", files, "the truth and at least one more file")
        result = self.score()
        console = Console(emoji=False)
        for table in score_tables(result, self.per):
            console.print(table)
        if self.out is not None:
            write_json(self.out, result.as_json())
        if self.picture is not None:
            save_figure(score_figure(result), self.picture)
        print_lines(console, *filter(None, (self.out, self.picture)))

    def score(self) -> TimelineScores:
        """Read the files and score the statements."""
        # Pandas; other commands start faster.
        from baselines.recordings.reading.modes import ModeFile, read_modes

        read = partial(
            read_modes,
            columns=columns_by_role(self.columns, ("time", "mode")),
            object_column=self.object,
            time_unit=self.time_unit,
        )
        truth = read(self.files[0])
        groups: list[list[Path]] = []
        stated: list[ModeFile] = []
        for path in self.files[1:]:
            file = read(path, dated=truth.dated)
            # Files of several objects are one set until it has all tracks of the truth.
            known = {*stated[-1].times} if stated else {*truth.times}
            if (
                len(truth.times) > 1
                and not known >= {*truth.times}
                and known.isdisjoint(file.times)
            ):
                groups[-1].append(path)
                stated[-1] = stated[-1].joined(file)
            else:
                groups.append([path])
                stated.append(file)
        names = set_names([common_path(paths) for paths in groups])
        sets = {name: file.like(truth, name) for name, file in zip(names, stated, strict=True)}
        return score(
            list(truth.times.values()),
            list(truth.modes.values()),
            {name: list(file.modes.values()) for name, file in sets.items()},
            statement_times={name: list(file.times.values()) for name, file in sets.items()},
            per=SECONDS[self.per],
            normal=self.normal,
        )


def common_path(paths: Sequence[Path]) -> Path:
    """Return the path of a file, or the folder that holds several ones."""
    return paths[0] if len(paths) == 1 else Path(os.path.commonpath([*map(Path.resolve, paths)]))


def set_names(paths: Sequence[Path]) -> list[str]:
    """Return the names of files without their endings; if these are equal, the parts of the paths
    that differ.
    """
    names = [
        path.name if path.is_dir() else Path(path.name.removesuffix(".gz")).stem for path in paths
    ]
    if len(set(names)) == len(names):
        return names
    parts = [[*path.resolve().parts] for path in paths]
    for at in (0, -1):
        while all(parts) and len({part[at] for part in parts}) == 1:
            for part in parts:
                del part[at]
    names = ["/".join(part) or name for part, name in zip(parts, names, strict=True)]
    if len(set(names)) < len(names):
        raise reject("files", [*map(str, paths)], "different files of statements")
    return names


def score_tables(result: TimelineScores, per: str) -> list[Table]:
    """Return the table of figures, and that of the differences if there are several sets."""
    # Heading, digits and factor of each figure.
    heads = {
        "agreement": ("agreement\n%", 1, 100.0),
        "delay": ("delay\ns", 2, 1.0),
        "misses": ("misses\n%", 1, 100.0),
        "full_delay": ("delay,\nall", 2, 1.0),
        "false_changes": (f"false\n/{per}", 2, 1.0),
        "false_per_1000": ("false\n/1000", 2, 1.0),
        "false_alarms": (f"alarms\n/{per}", 2, 1.0),
        "changes_per_switch": ("changes", 2, 1.0),
    }
    notes = (
        "\ndelay: from a switch to the first right statement."
        "\nmisses: switches followed by another one before that."
        "\ndelay, all: without it, until the next switch or the end of the track."
        "\nfalse: changes to a mode that is not true until the next change, per"
        f" {per} or 1,000 samples."
        "\nchanges: of the statement, per switch."
    )
    if result.normal is None:
        del heads["false_alarms"]
    else:
        notes += (
            f"\nalarms: false changes away from {result.normal}, per {per} in which it is true."
        )
    over = "No intervals: they need several tracks, or one of at least 20 switches."
    if result.unit:
        over = f"± half width of the 95 % interval over {result.unit}."

    def table(title: str, caption: str, sets: Mapping[str, Any], sign: str = "") -> Table:
        rows = [
            [
                escape(name),
                *(
                    estimate_cell(figures[key], scale, digits, sign=sign)
                    for key, (_, digits, scale) in heads.items()
                ),
            ]
            for name, figures in sets.items()
        ]
        return filled_table(
            title, ["statements", *(head for head, *_ in heads.values())], rows, caption
        )

    first, *others = result.scores
    scored = float(result.scores[first].of("scored", 0).sum()) / result.period
    tables = [
        table(
            f"Statements on {counted(result.tracks, 'track')}, {scored:.4g} {per} scored",
            over + notes,
            result.estimates,
        )
    ]
    if others:
        title = f"Less that of {first}, on the same tracks"
        tables.append(table(title, over, result.differences, "+"))
    return tables


def score_figure(result: TimelineScores) -> "Figure":
    """Return a picture of truth and statements over time on the first tracks; wrong ones are
    hatched.
    """
    from matplotlib import colormaps
    from matplotlib.colors import to_hex
    from matplotlib.patches import Patch

    # In the picture.
    tracks = min(result.tracks, 4)
    canvas = new_canvas(0.8 + tracks * (0.6 + 0.3 * (1 + len(result.timelines))), 10.0)
    grid = canvas.subplots(tracks, 1, squeeze=False)[:, 0]
    colours = [to_hex(colormaps["tab10"](k % 10)) for k in range(len(result.modes))]
    for number, axes in enumerate(grid):
        lines = {name: timelines[number] for name, timelines in result.timelines.items()}
        clock = np.unique(np.concatenate([line.times for line in lines.values()]))
        rows: dict[str, IntArray] = {}
        wrong = {}
        for name, line in lines.items():
            at = np.searchsorted(line.times, clock[:-1], "right") - 1
            rows.setdefault("truth", np.where(line.scored, line.modes, -1)[at])
            rows[name] = line.stated[at]
            wrong[name] = (rows[name] != rows["truth"]) & (rows["truth"] >= 0) & (rows[name] >= 0)
        draw_timelines(axes, clock, rows, colours, "t [s]", wrong=wrong)
    handles = [
        Patch(color=colour, label=str(mode))
        for colour, mode in zip(colours, result.modes, strict=True)
    ]
    handles += legend_patches()
    legend_beside(grid[0], handles=handles)
    return canvas
