"""Published and reproduced table values, and the sampling interval of a study of the paper's
size.
"""

import functools
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


RESAMPLES = 2000
# Of the studies in Golubkov 2018 and Tsyganov 2019.
PAPER_RUNS = 100

STUDY_INTERVAL = f"The interval contains 95 % of studies with {PAPER_RUNS} runs."
# Components of the state [m, m/s], and the norm of their RMSE.
STATES = ("x1", "x2", "x3", "x4", "nRMSE")


@dataclass(frozen=True)
class Cell:
    """One value of a table."""

    table: str
    row: str
    column: str
    # NaN if it is illegible or not given.
    published: float
    # The same quantity from all runs of the reproduction.
    ours: float
    # Bounds of the 95 % interval that `note` describes.
    low: float
    high: float
    # Decimals to print.
    digits: int = 4
    note: str = STUDY_INTERVAL
    # 95 % interval of `ours` itself, NaN if it is not known.
    own_low: float = math.nan
    own_high: float = math.nan
    # Of the quantity of single runs, NaN if it is not known.
    median: float = math.nan
    # Why the value is no evidence, as a setting was fitted to it; it is then not counted.
    excuse: str = ""

    @property
    def verdict(self) -> str:
        """Whether the published value is "inside" or "outside" the interval, or "not published"."""
        if math.isnan(self.published):
            return "not published"
        return "inside" if self.low <= self.published <= self.high else "outside"

    def as_json(self) -> dict[str, Any]:
        """Values for JSON, with None for NaN."""
        values = {key: value for key, value in vars(self).items() if key not in ("digits", "note")}
        plain = {
            key: None if isinstance(value, float) and math.isnan(value) else value
            for key, value in values.items()
        }
        return plain | {"verdict": self.verdict, "note": self.note}


@dataclass(frozen=True)
class Finding:
    """A result that the paper does not tabulate, as text, and what the paper claims of it, if
    anything.
    """

    name: str
    value: str
    claim: str = ""


@dataclass(frozen=True)
class Reproduction:
    """All results of the reproduction of a paper."""

    # Citation key.
    paper: str
    runs: int
    # Of the simulated recordings.
    seed: int
    # Values of the published tables.
    cells: tuple[Cell, ...]
    # Results beyond the published tables.
    findings: tuple[Finding, ...]
    # Recording and result for each figure, by the name of the setting.
    examples: dict[str, Any]
    # With fewer, the centre of the interval is itself too uncertain.
    recommended_runs: int = 500
    # What the paper states on its number of runs.
    size: str = f"{PAPER_RUNS} runs"

    @property
    def tables(self) -> dict[str, list[Cell]]:
        """Cells of each table, in the order of the paper."""
        tables: dict[str, list[Cell]] = {}
        for cell in self.cells:
            tables.setdefault(cell.table, []).append(cell)
        return tables

    def count(self) -> dict[str, dict[str, tuple[int, int]]]:
        """Number of published values inside the interval and in total, by table and
        `Cell.excuse`, "" without one.
        """
        counts: dict[str, dict[str, tuple[int, int]]] = {}
        for cell in self.cells:
            if cell.verdict != "not published":
                of_table = counts.setdefault(cell.table, {})
                inside, total = of_table.get(cell.excuse, (0, 0))
                of_table[cell.excuse] = inside + (cell.verdict == "inside"), total + 1
        return counts


def study_interval(
    per_run: FloatArray,
    statistics: Callable[[FloatArray], FloatArray],
    seed: int,
    study_runs: int = PAPER_RUNS,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Statistics (C,) of all runs, and the bounds of the 95 % bootstrap interval of a study with
    fewer runs, (C,). `per_run` has (n, F) values; `statistics` makes (..., C) of means over runs,
    (..., F).
    """
    resampled = statistics(_draws(seed, study_runs, len(per_run)) @ per_run / study_runs)
    low, high = np.percentile(
        resampled,
        [2.5, 97.5],
        axis=0,
    )
    return statistics(per_run.mean(0)), low, high


def both_intervals(
    per_run: FloatArray,
    statistics: Callable[[FloatArray], FloatArray],
    seed: int,
    study_runs: int = PAPER_RUNS,
) -> tuple[FloatArray, ...]:
    """`study_interval`, then the 95 % interval of its first result, and the median of single
    runs.
    """
    _, low, high = study_interval(
        per_run,
        statistics,
        seed,
        len(per_run),
    )
    median = np.median(statistics(per_run), axis=0)
    return (*study_interval(per_run, statistics, seed, study_runs), low, high, median)


@functools.lru_cache(maxsize=4)
def _draws(
    seed: int,
    study_runs: int,
    runs: int,
) -> FloatArray:
    """How often each run is drawn in each resample, (`RESAMPLES`, runs)."""
    drawn = np.random.default_rng(seed).multinomial(
        study_runs,
        np.full(runs, 1.0 / runs),
        RESAMPLES,
    )
    return drawn.astype(np.float64)


def paired_ratio(
    errors: FloatArray,
    others: FloatArray,
    seed: int,
) -> tuple[float, float, float]:
    """Ratio of the mean errors (runs, F) of two filters, and its 95 % bootstrap interval over
    flights.
    """
    both = np.stack([errors.mean(0), others.mean(0)], axis=-1)
    value, low, high = study_interval(
        both,
        lambda means: means[..., 0] / means[..., 1],
        seed,
        len(both),
    )
    return float(value), float(low), float(high)


def rmse_row(
    table: str,
    row: str,
    published: Iterable[float],
    estimates: FloatArray,
    truth: FloatArray,
    seed: int,
) -> list[Cell]:
    """Cells of one row of RMSE in the columns `STATES`, of estimates and truth (n, T, 4)."""

    def rmse_and_norm(mean_squares: FloatArray) -> FloatArray:
        roots = np.sqrt(mean_squares)
        return np.concatenate([roots, np.sqrt((roots**2).sum(-1, keepdims=True))], axis=-1)

    interval = both_intervals(
        ((estimates - truth) ** 2).mean(1),
        rmse_and_norm,
        seed,
    )
    return table_row(table, row, STATES, published, interval)


def table_row(
    table: str,
    row: str,
    columns: Iterable[str],
    published: Iterable[float],
    interval: Iterable[Iterable[float]],
    digits: int = 4,
    note: str = STUDY_INTERVAL,
    excuses: Mapping[str, str] | None = None,
) -> list[Cell]:
    """Cells of one row of a table with C columns; `published` is NaN where there is no value,
    `interval` the results (C,) of `study_interval` or `both_intervals`; `excuses` are by column.
    """
    found = np.array([*interval], np.float64).T.tolist()
    cells = []
    for column, value, (ours, low, high, *more) in zip(columns, published, found, strict=True):
        own = dict(zip(("own_low", "own_high", "median"), more, strict=False))
        excuse = (excuses or {}).get(column, "")
        cells.append(
            Cell(table, row, column, value, ours, low, high, digits, note, **own, excuse=excuse)
        )
    return cells
