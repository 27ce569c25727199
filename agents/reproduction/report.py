"""Tables of a reproduction as Markdown, for the terminal too, and as JSON, and the files beside them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.markdown import Markdown

from agents.evaluation.cells import markdown_table
from agents.interface.output_files import write_files
from baselines.papers.reproduction import Cell, Reproduction

HEADER = ("setting", "quantity", "published", "ours [its own interval]", "median run", "95 % interval", "inside")
INSIDE = {"inside": "yes", "outside": "no", "not published": "-"}
FINDINGS_HEADER = ("quantity", "result", "claim of the paper")
SUMMARY_HEADER = ("paper, its size", "table", "inside the 95 % interval", "outside the 95 % interval", "not counted")


def _row(cell: Cell) -> tuple[str, ...]:
    """Texts of a cell, in the order of `HEADER`."""

    def text(*values: float) -> str:
        return "-" if np.isnan(values).any() else " to ".join(f"{value:.{cell.digits}f}" for value in values)

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
    """Rows beside columns of a table without published values; "" if it has some, or not all of ours."""
    values = {(row, column): f"{ours} ({interval})" for row, column, _, ours, _, interval, _ in map(_row, cells)}
    rows, columns = (list(dict.fromkeys(names)) for names in zip(*values, strict=True))
    if len(values) < len(rows) * len(columns) or any(cell.verdict != "not published" for cell in cells):
        return ""
    return markdown_table(("", *columns), [(row, *(values[row, one] for one in columns)) for row in rows])


def to_markdown(result: Reproduction) -> str:
    """All tables of one paper."""
    text = [f"# Reproduction of {result.paper}\n", f"{describe_runs(result)}\n"]
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
            others = [f"{excuse}: {own} of {all_} inside" for excuse, (own, all_) in counts.items()]
            count, none = (f"{inside} of {total}", "none") if total else ("-", "-")
            outsiders, excused = "; ".join(outside) or none, "; ".join(others) or "none"
            rows.append((f"{result.paper}, {result.size}", name, count, outsiders, excused))
    return markdown_table(SUMMARY_HEADER, rows)


def print_report(
    paper: str, result: Reproduction, figures: Mapping[str, Figure], seconds: float, folder: Path, console: Console
) -> None:
    """Print the tables of a paper, and write them and the figures, which come by file name."""
    text, cells = to_markdown(result), [cell.as_json() for cell in result.cells]
    values = {"paper": result.paper, "runs": result.runs, "seed": result.seed, "cells": cells}
    values |= {"findings": [vars(finding) for finding in result.findings]}
    console.print(Markdown(text))
    files = write_files(folder, {f"{paper}.md": text, f"{paper}.json": values, **figures})
    line = f"{describe_runs(result)} Computed in {seconds:.2f} s. {files}\n"
    console.print(line, markup=False, highlight=False)
