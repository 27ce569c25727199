"""The cells of a file, what its columns mean, and what was left out or assumed on the way."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from baselines.recordings.reading.names import split_unit
from baselines.recordings.reading.values import Parser, parse_numbers
from hybrid_env.checks import BoolArray, FloatArray, IntArray


@dataclass(eq=False)
class Table:
    """Cells of a file, before it is known what they mean."""

    # One column for each of `names`, labelled by its number from 0; rows by their lines, from 1.
    frame: pd.DataFrame
    # Whether the file names its columns.
    headed: bool = True
    # Number of the column of each role that is read.
    roles: dict[str, int] = field(default_factory=dict)
    # Mark between thousands in its numbers.
    thousands: str | None = None
    # (n,) a number for the segment of a GPX track of each row.
    segments: IntArray | int = 0
    # Lines that were left out, by the reason.
    left_out: dict[str, list[int]] = field(default_factory=dict)
    # Its path for messages, shortened.
    file: str = ""
    # What was assumed, for the summary.
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        # Of the columns as in the file; empty for one without a name, also an index of pandas.
        self.names = ["" if "__index_level_" in name else name for name in self.frame.columns]
        self.frame = self.frame.set_axis(range(len(self.names)), axis=1)

    def cells(self, role: str) -> "pd.Series[Any]":
        """Return the column of a role."""
        return self.frame[self.roles[role]]

    def unit(self, role: str) -> str | None:
        """Return the unit that the header names for a role."""
        return split_unit(self.names[self.roles[role]])[1]

    def numbers(self, role: str, parse: Parser = parse_numbers) -> tuple[FloatArray, BoolArray]:
        """Return the numbers of the column of a role, NaN where a cell is none, and which cells are
        not empty and no numbers.
        """
        values, wrong, comma = parse(self.cells(role), self.thousands)
        self.notes += ["decimal comma"] * comma
        return values, wrong

    def label(self, column: int | str) -> str:
        """Return the name of a column, or of that of a role, for a message."""
        number = self.roles[column] if isinstance(column, str) else column
        return self.names[number] or f"column {number + 1}"

    def add(self, name: str, cells: "pd.Series[Any]") -> int:
        """Add a column and return its number."""
        self.names.append(name)
        self.frame[len(self.names) - 1] = cells
        return len(self.names) - 1

    def leave_out(self, reason: str, lines: Any) -> None:
        """Note lines that are left out."""
        if len(lines):
            self.left_out.setdefault(reason, []).extend(int(line) for line in lines)

    def without(self, rows: pd.DataFrame, wrong: Any, reason: str) -> pd.DataFrame:
        """Return the rows but for those that are wrong, (n,), whose lines are noted."""
        wrong = np.asarray(wrong, np.bool_)
        self.leave_out(reason, rows.index[wrong])
        return rows[~wrong]

    def listed(self) -> str:
        """Return the names of the columns for a message."""
        if not any(self.names):
            return f"it has {len(self.names)} columns without names"
        shown = [name for name in self.names if name][:8]
        return f"its columns are {', '.join(shown)}{' ...' * (len(self.names) > 8)}"
