"""The cells of a file, and what was left out or assumed on the way."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from hybrid_env.checks import IntArray

REPEATED = "repeated times"


@dataclass(eq=False)
class Table:
    """Cells of a file, before it is known what they mean."""

    # Its path for messages, shortened.
    file: str
    # One column for each of `names`, labelled by its number from 0; rows by their lines, from 1.
    frame: pd.DataFrame
    # Whether the file names its columns.
    headed: bool = True
    # (n,) a number for the segment of a GPX track of each row.
    segments: IntArray | int = 0
    # Why rows with one time are left out.
    repeats: str = REPEATED
    # Lines that were left out, by the reason.
    left_out: dict[str, list[int]] = field(default_factory=dict)
    # What was assumed, for the summary.
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        # Of the columns as in the file; empty for one without a name, also an index of pandas.
        self.names = ["" if "__index_level_" in name else name for name in self.frame.columns]
        self.frame = self.frame.set_axis(range(len(self.names)), axis=1)
        self.lines: IntArray = self.frame.index.to_numpy()

    def label(self, column: int) -> str:
        """Return the name of a column for a message."""
        return self.names[column] or f"column {column + 1}"

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
