"""Published figures beside one's own: cells of tables, and the spread of a study of the paper's size."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
RESAMPLES = 2000
PAPER_RUNS = 100  # runs of the studies in Golubkov 2018 and Tsyganov 2019


@dataclass(frozen=True)
class Cell:
    """One figure of a table.

    Attributes:
        table, row, column: where it stands.
        published: as printed; NaN where the print is illegible or gives none.
        ours: the same figure from all our runs.
        low, high: 95 % interval of the figure in a study with the paper's number of runs.
        digits: after the point, for tables.
        note: what else must be known.
    """

    table: str
    row: str
    column: str
    published: float
    ours: float
    low: float
    high: float
    digits: int = 4
    note: str = ""

    @property
    def verdict(self) -> str:
        """Whether the published figure lies "inside" or "outside" the interval, or is "no figure"."""
        if math.isnan(self.published):
            return "no figure"
        return "inside" if self.low <= self.published <= self.high else "outside"

    def as_json(self) -> dict[str, Any]:
        """Plain values, None for NaN."""
        values = {
            key: getattr(self, key) for key in ("table", "row", "column", "published", "ours", "low", "high")
        }
        return {
            key: None if isinstance(value, float) and math.isnan(value) else value
            for key, value in values.items()
        } | {"verdict": self.verdict, "note": self.note}


@dataclass(frozen=True)
class Finding:
    """A figure that the paper does not print, or claims without one.

    Attributes:
        name: what it is.
        value: the figure in words.
        claim: what the paper says, if anything.
    """

    name: str
    value: str
    claim: str = ""


@dataclass(frozen=True)
class Reproduction:
    """All cells of a paper, what else was found, and recordings for its figures.

    Attributes:
        paper: as cited.
        runs, seed: of our study.
        cells: of the published tables.
        findings: beyond the tables.
        pictures: data for the figures, by name.
    """

    paper: str
    runs: int
    seed: int
    cells: tuple[Cell, ...]
    findings: tuple[Finding, ...]
    pictures: dict[str, Any]

    @property
    def tables(self) -> dict[str, list[Cell]]:
        """The cells of each table, in the paper's order."""
        tables: dict[str, list[Cell]] = {}
        for cell in self.cells:
            tables.setdefault(cell.table, []).append(cell)
        return tables

    def count(self) -> dict[str, tuple[int, int]]:
        """Per table with published figures: cells inside, cells in all."""
        verdicts = {name: [cell.verdict for cell in cells] for name, cells in self.tables.items()}
        return {
            name: (found.count("inside"), len(found) - found.count("no figure"))
            for name, found in verdicts.items()
            if set(found) != {"no figure"}
        }


def study_spread(
    per_run: FloatArray, figures: Callable[[FloatArray], FloatArray], seed: int, study_runs: int = PAPER_RUNS
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Figures of all runs, and the bounds between which 95 % of studies with fewer runs find them.

    Args:
        per_run: (n, F) values of each run.
        figures: (..., F) means over runs -> (..., C) figures.
        seed: of the resampling.
        study_runs: runs of one study.

    Returns:
        (C,) figures, lower and upper bounds.
    """
    generator = np.random.default_rng(seed)
    draws = generator.multinomial(study_runs, np.full(len(per_run), 1.0 / len(per_run)), RESAMPLES)
    spread = figures(draws @ per_run / study_runs)
    low, high = np.percentile(spread, [2.5, 97.5], axis=0)
    return figures(per_run.mean(0)), low, high


def rmse_figures(means: FloatArray) -> FloatArray:
    """(..., 4) mean squared errors -> (..., 5) RMSE of each component and nRMSE, their Euclidean norm."""
    roots = np.sqrt(means)
    return np.concatenate([roots, np.sqrt((roots**2).sum(-1, keepdims=True))], axis=-1)


def cells_of(
    table: str,
    row: str,
    columns: tuple[str, ...],
    published: tuple[float, ...],
    spread: tuple[FloatArray, FloatArray, FloatArray],
    digits: int = 4,
    note: str = "",
) -> list[Cell]:
    """A row of cells."""
    return [
        Cell(table, row, column, printed, float(ours), float(low), float(high), digits, note)
        for column, printed, ours, low, high in zip(columns, published, *spread, strict=True)
    ]
