"""Published and reproduced values as tables in Markdown."""

from collections.abc import Iterable, Sequence

import numpy as np

from studies.papers.reproduction import Cell, Reproduction

HEADER = (
    "setting",
    "quantity",
    "published",
    "ours [its own interval]",
    "median run",
    "95 % interval",
    "inside",
)
INSIDE = {
    "inside": "yes",
    "outside": "no",
    "not published": "-",
}
FINDINGS_HEADER = ("quantity", "result", "claim of the paper")
SUMMARY_HEADER = (
    "paper, its size",
    "table",
    "inside the 95 % interval",
    "outside the 95 % interval",
    "not counted",
)


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    head, *lines = (f"| {' | '.join(row)} |\n" for row in (heads, *rows))
    return "".join([head, "|" + "---|" * len(heads) + "\n", *lines])


def _row(cell: Cell) -> tuple[str, ...]:
    """Texts of a cell, in the order of `HEADER`."""

    def text(*values: float) -> str:
        return (
            "-"
            if np.isnan(values).any()
            else " to ".join(f"{value:.{cell.digits}f}" for value in values)
        )

    own = text(cell.own_low, cell.own_high)
    ours = text(cell.ours) + (f" [{own}]" if own != "-" else "")
    verdict = INSIDE[cell.verdict] + (f" ({cell.excuse})" if cell.excuse else "")
    interval = text(cell.low, cell.high)
    return cell.row, cell.column, text(cell.published), ours, text(cell.median), interval, verdict


def describe_runs(result: Reproduction) -> str:
    """Number of runs and seed, with a recommendation if there are few runs."""
    least = result.recommended_runs
    few = f" At least {least} runs are recommended." if result.runs < least else ""
    return f"{result.runs} runs, seed {result.seed}.{few}"


def _unpublished(cells: Sequence[Cell]) -> str:
    """Rows beside columns of a table without published values; "" if it has some, or not all of
    ours.
    """
    values = {
        (row, column): f"{ours} ({interval})"
        for row, column, _, ours, _, interval, _ in map(_row, cells)
    }
    rows, columns = (list(dict.fromkeys(names)) for names in zip(*values, strict=True))
    if len(values) < len(rows) * len(columns) or any(
        cell.verdict != "not published" for cell in cells
    ):
        return ""
    return markdown_table(
        ("", *columns),
        [(row, *(values[row, column] for column in columns)) for row in rows],
    )


def to_markdown(result: Reproduction) -> str:
    """All tables of one paper."""
    text = [
        f"# Reproduction of {result.paper}\n",
        f"{describe_runs(result)}\n",
    ]
    for name, cells in result.tables.items():
        inside, total = result.count().get(name, {}).get("", (0, 0))
        count = f", {inside} of {total} inside the interval" if total else ""
        notes = " ".join(dict.fromkeys(cell.note for cell in cells if cell.note))
        text += [f"## {result.paper}: {name}{count}\n", f"{notes}\n"]
        text += [_unpublished(cells) or markdown_table(HEADER, [_row(cell) for cell in cells])]
    rows = [(finding.name, finding.value, finding.claim) for finding in result.findings]
    text += ["## Additional results\n", markdown_table(FINDINGS_HEADER, rows)]
    return "\n".join(text)


def summary_markdown(results: Sequence[Reproduction]) -> str:
    """Number of published values inside the interval by table, and the values outside."""
    rows = []
    for result in results:
        for name, counts in result.count().items():
            inside, total = counts.pop("", (0, 0))
            outside = [
                "{} {} {} (ours {})".format(*_row(cell))
                for cell in result.tables[name]
                if cell.verdict == "outside" and not cell.excuse
            ]
            others = [
                f"{excuse}: {part} of {whole} inside" for excuse, (part, whole) in counts.items()
            ]
            count, none = (f"{inside} of {total}", "none") if total else ("-", "-")
            outsiders = "; ".join(outside) or none
            excused = "; ".join(others) or "none"
            rows.append((f"{result.paper}, {result.size}", name, count, outsiders, excused))
    return markdown_table(SUMMARY_HEADER, rows)


def to_json(result: Reproduction) -> dict[str, object]:
    """All values of one paper, for JSON."""
    return {
        "paper": result.paper,
        "runs": result.runs,
        "seed": result.seed,
        "cells": [cell.as_json() for cell in result.cells],
        "findings": [vars(finding) for finding in result.findings],
    }
