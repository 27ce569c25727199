"""Published values beside ours, with the interval of a study of the paper's size, as tables in
Markdown.
"""

import functools
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from studies.arrays import FloatArray
from studies.results import markdown_table

# A result beyond the tables: quantity, value, and what the paper claims of it, if anything.
Finding = tuple[str, str, str]


@dataclass(frozen=True)
class Reproduction:
    """All results of the reproduction of a paper."""

    # Citation key.
    paper: str
    runs: int
    # Seed of the simulated recordings.
    seed: int
    # Parts of the tables, see `table_row`.
    rows: Sequence[pd.DataFrame]
    # Results beyond the published tables.
    findings: Sequence[Finding]
    # What the paper states on its number of runs.
    size: str = "100 runs"

    @property
    def cells(self) -> pd.DataFrame:
        """All values, a line each."""
        cells = pd.concat(self.rows, ignore_index=True)
        inside = cells.published.between(cells.low, cells.high)
        verdicts = inside.map({True: "inside", False: "outside"})
        return cells.assign(verdict=verdicts.mask(cells.published.isna(), "not published"))

    @property
    def tables(self) -> dict[Any, pd.DataFrame]:
        """Cells of each table, in the order of the paper."""
        return dict(list(self.cells.groupby("table", sort=False)))

    def as_json(self) -> dict[str, Any]:
        """Return all values as plain ones."""
        return {
            "paper": self.paper,
            "runs": self.runs,
            "seed": self.seed,
            "cells": json.loads(self.cells.drop(columns="digits").to_json(orient="records")),
            "findings": self.findings,
        }


def table_row(
    table: str,
    row: str,
    columns: Iterable[str],
    published: Any,
    results: Iterable[Any],
    digits: Any = 4,
    note: str = "The interval contains 95 % of studies with 100 runs.",
    excuses: Any = "",
) -> pd.DataFrame:
    """Return a row of a table with C columns, a line for each value.

    Args:
        table, row, columns: names.
        published: values (C,), NaN where there is none or where it is illegible.
        results: the first ones of `intervals`, (C,) each.
        digits: decimals to print.
        note: what the interval contains.
        excuses: (C,) why a value is no evidence, as a setting was fitted to it; it is then not
            counted.
    """
    names = ("ours", "low", "high", "own_low", "own_high")
    return pd.DataFrame(
        {
            "table": table,
            "row": row,
            "column": [*columns],
            "published": published,
            **dict.fromkeys(names, np.nan),
            **dict(zip(names, results, strict=False)),
            "digits": digits,
            "note": note,
            "excuse": excuses,
        }
    )


def intervals(
    per_run: FloatArray,
    statistics: Callable[[FloatArray], FloatArray],
    seed: int,
    study_runs: int = 100,
) -> list[FloatArray]:
    """Return statistics of all runs, and the bounds of the 95 % bootstrap interval of a study with
    fewer runs and those of our own, (C,) each.

    `per_run` has (n, F) values; `statistics` makes (..., C) of means over runs, (..., F).
    """
    results = [statistics(per_run.mean(0))]
    for runs in (study_runs, len(per_run)):
        resampled = statistics(_draws(seed, runs, len(per_run)) @ per_run / runs)
        results += [*np.percentile(resampled, [2.5, 97.5], axis=0)]
    return results


@functools.lru_cache(maxsize=4)
def _draws(seed: int, study_runs: int, runs: int, resamples: int = 2000) -> FloatArray:
    """How often each run is drawn in each resample, (resamples, runs)."""
    shares = np.full(runs, 1.0 / runs)
    drawn = np.random.default_rng(seed).multinomial(study_runs, shares, resamples)
    return drawn.astype(np.float64)


def rmse_row(
    table: str,
    row: str,
    published: Sequence[float],
    estimates: FloatArray,
    truth: FloatArray,
    seed: int,
) -> pd.DataFrame:
    """Row of the RMSE of the components of the state [m, m/s], and of their norm, of estimates and
    truth (n, T, 4).
    """

    def rmse_and_norm(mean_squares: FloatArray) -> FloatArray:
        roots = np.sqrt(mean_squares)
        return np.concatenate([roots, np.sqrt((roots**2).sum(-1, keepdims=True))], axis=-1)

    results = intervals(((estimates - truth) ** 2).mean(1), rmse_and_norm, seed)
    return table_row(table, row, ("x1", "x2", "x3", "x4", "nRMSE"), published, results)


def _texts(cells: pd.DataFrame) -> pd.DataFrame:
    """Cells as texts below the heads of a table."""

    def text(*names: str) -> pd.Series:
        lines = cells[["digits", *names]].itertuples(index=False)
        texts = [
            " to ".join(f"{value:.{digits}f}" for value in values) for digits, *values in lines
        ]
        return pd.Series(texts, cells.index).mask(cells[[*names]].isna().any(axis=1), "-")

    words = cells.verdict.map({"inside": "yes", "outside": "no", "not published": "-"})
    return pd.DataFrame(
        {
            "setting": cells.row,
            "quantity": cells.column,
            "published": text("published"),
            "ours [its own interval]": text("ours")
            + (" [" + text("own_low", "own_high") + "]").replace(" [-]", ""),
            "95 % interval": text("low", "high"),
            "inside": words + (" (" + cells.excuse + ")").replace(" ()", ""),
        }
    )


def _table(cells: pd.DataFrame) -> str:
    """Return a table of cells; without published values, it has a line for each setting."""
    texts = _texts(cells)
    if cells.published.isna().all():
        ours = texts["ours [its own interval]"] + " (" + texts["95 % interval"] + ")"
        index = texts[["setting", "quantity"]].to_numpy().T
        texts = ours.set_axis([*index]).unstack(sort=False).rename_axis("").reset_index()
    return markdown_table([*texts], texts.itertuples(index=False))


def _count(cells: pd.DataFrame) -> str:
    """How many of the published values of cells are inside."""
    published = cells[cells.verdict != "not published"]
    return f"{(published.verdict == 'inside').sum()} of {len(published)}" if len(published) else ""


def to_markdown(result: Reproduction) -> str:
    """All tables of one paper."""
    text = [f"# Reproduction of {result.paper}\n", f"{result.runs} runs, seed {result.seed}.\n"]
    for name, cells in result.tables.items():
        count = _count(cells[cells.excuse == ""])
        inside = f", {count} inside the interval" if count else ""
        heading = f"## {result.paper}: {name}{inside}\n"
        text += [heading, f"{' '.join(cells.note.unique())}\n", _table(cells)]
    if result.findings:
        heads = ("quantity", "result", "claim of the paper")
        text += ["## Additional results\n", markdown_table(heads, result.findings)]
    return "\n".join(text)


def summary(results: Sequence[Reproduction]) -> str:
    """Number of published values inside the interval by table, and the values outside."""
    rows = []
    for result in results:
        for name, cells in result.tables.items():
            if not _count(cells):
                continue
            counted = cells[cells.excuse == ""]
            count = _count(counted)
            outside = "; ".join(
                f"{row} {column} {published} (ours {ours})"
                for row, column, published, ours, *_ in _texts(
                    counted[counted.verdict == "outside"]
                ).itertuples(index=False)
            )
            excused = "; ".join(
                f"{excuse}: {_count(part)} inside"
                for excuse, part in cells[cells.excuse != ""].groupby("excuse")
            )
            outside = outside or "none" if count else "-"
            paper = f"{result.paper}, {result.size}"
            rows.append((paper, name, count or "-", outside, excused or "none"))
    heads = (
        "paper, its size",
        "table",
        "inside the 95 % interval",
        "outside the 95 % interval",
        "not counted",
    )
    return markdown_table(heads, rows)
