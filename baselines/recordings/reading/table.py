"""The table of a file: its cells by column, before it is known what they mean."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray

LONGEST_NAME = 80  # characters of the path in a message


@dataclass(frozen=True, eq=False)
class Table:
    """Cells of a file.

    Attributes:
        file: path of the file for messages, shortened.
        frame: the cells, one column for each of `names`, labelled by its number from 0.
        names: names of the columns as in the file; empty for a column without a name.
        headed: whether the file names its columns.
        row_word: what a row is called in messages: line, row or point.
        first_row: number of the first row in messages.
        segments: (n,) number of the segment of a GPX track of each row; None for other files.
        notes: what was left out or assumed, for the summary.
    """

    file: str
    frame: pd.DataFrame
    names: tuple[str, ...]
    headed: bool = True
    row_word: str = "row"
    first_row: int = 1
    segments: NDArray[np.int64] | None = None
    notes: list[str] = field(default_factory=list)

    def place(self, row: int) -> str:
        """Return file and row for a message.

        Args:
            row: number of the row from 0.
        """
        return f"{self.file}, {self.row_word} {row + self.first_row}"

    def label(self, column: int) -> str:
        """Return the name of a column for a message."""
        return self.names[column] or f"column {column + 1}"


def counted(number: int, word: str) -> str:
    """Return a number and a word, in the plural if need be."""
    return f"{number:,} {word}" + ("" if number == 1 else "s")


def short_name(path: str) -> str:
    """Return a path for a message, without the start of a long one."""
    return path if len(path) <= LONGEST_NAME else f"...{path[-LONGEST_NAME:]}"
