"""From cells to numbers."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from baselines.recordings.reading.table import Table
from baselines.recordings.reading.text import MISSING
from hybrid_env.checks import reject

MAX_VALUE = 1e12
"""Largest absolute value of a coordinate; its powers do not overflow."""

DECIMAL_COMMA = r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?"


@dataclass(frozen=True, eq=False)
class Numbers:
    """Cells of a column as numbers.

    Attributes:
        values: (n,) the numbers; NaN where a cell is empty, and where it is not a number.
        wrong: rows whose cell is neither a number nor empty.
        comma: whether the decimal separator is a comma.
    """

    values: NDArray[np.float64]
    wrong: NDArray[np.int64]
    comma: bool = False


def parse_numbers(cells: "pd.Series[object]") -> Numbers:
    """Parse cells as numbers with a decimal point, or all with a decimal comma."""
    if pd.api.types.is_bool_dtype(cells) or pd.api.types.is_datetime64_any_dtype(cells):
        return Numbers(np.full(len(cells), np.nan), np.arange(len(cells)))
    if pd.api.types.is_numeric_dtype(cells):
        return Numbers(cells.to_numpy(np.float64, na_value=np.nan), np.empty(0, np.int64))
    texts = cells.astype("str").str.strip()
    empty = (cells.isna() | texts.isin(MISSING)).to_numpy()
    values = _numbers(texts)
    wrong = np.isnan(values) & ~empty
    commas = texts[wrong].str.fullmatch(DECIMAL_COMMA)
    if wrong.any() and commas.all() and not texts[~wrong & ~empty].str.contains(".", regex=False).any():
        values[wrong] = _numbers(texts[wrong].str.replace(",", "."))
        return Numbers(values, np.empty(0, np.int64), comma=True)
    return Numbers(values, np.flatnonzero(wrong))


def coordinates(table: Table, column: int, limit: float = MAX_VALUE) -> Numbers:
    """Parse a column of coordinates.

    Raises:
        ArgumentError: a cell is text, infinite or larger than the limit.
    """
    cells = table.frame[column]
    found = parse_numbers(cells)
    wrong = np.union1d(found.wrong, np.flatnonzero(np.abs(found.values) > limit))
    if wrong.size:
        row = int(wrong[0])
        raise reject(
            f"{table.place(row)}: {table.label(column)}",
            _shown(cells.iloc[row]),
            f"a finite number of magnitude at most {limit:g}, or an empty cell",
        )
    return found


def _numbers(texts: "pd.Series[str]") -> NDArray[np.float64]:
    return np.array(pd.to_numeric(texts, errors="coerce"), np.float64)


def _shown(cell: object) -> object:
    return cell if isinstance(cell, (str, float, int, bool)) else str(cell)
