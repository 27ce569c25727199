"""Reproductions as tables for the terminal, Markdown and JSON."""

import math
from collections.abc import Sequence
from typing import Any

from rich import box
from rich.table import Table

from baselines.papers.reproduction import Cell, Reproduction

ENOUGH_RUNS = 500  # with fewer the middle of the interval is itself too uncertain for a verdict
HEADS = ("row", "figure", "published", "ours", "95 % of studies", "verdict")


def _words(cell: Cell) -> tuple[str, ...]:
    published = "-" if math.isnan(cell.published) else f"{cell.published:.{cell.digits}f}"
    spread = f"{cell.low:.{cell.digits}f} to {cell.high:.{cell.digits}f}"
    return cell.row, cell.column, published, f"{cell.ours:.{cell.digits}f}", spread, cell.verdict


def _title(result: Reproduction, table: str) -> str:
    inside = result.count().get(table)
    count = f", {inside[0]} of {inside[1]} inside" if inside else ""
    return f"{result.paper}: {table}{count}"


def _caption(result: Reproduction) -> str:
    few = "" if result.runs >= ENOUGH_RUNS else f"; {result.runs} runs are few for a verdict, take 1000"
    return f"{result.runs} runs, seed {result.seed}{few}"


def tables(result: Reproduction) -> list[Table]:
    """One table for each of the paper's, and one of what else was found."""
    made = []
    for name, cells in result.tables.items():
        table = Table(title=_title(result, name), caption=_caption(result), box=box.SIMPLE_HEAD)
        for head in HEADS:
            table.add_column(head, justify="left" if head in ("row", "figure", "verdict") else "right")
        row = ""
        for cell in cells:
            if row and cell.row != row:
                table.add_section()
            words = list(_words(cell))
            words[0] = "" if cell.row == row else words[0]
            row = cell.row
            style = {"inside": "green", "outside": "red"}.get(cell.verdict, "bright_black")
            table.add_row(*words[:-1], f"[{style}]{words[-1]}[/]")
        made.append(table)
    table = Table(title=f"{result.paper}: beyond the tables", box=box.SIMPLE_HEAD, show_lines=False)
    for head in ("what", "found", "the paper says"):
        table.add_column(head)
    for finding in result.findings:
        table.add_row(finding.name, finding.value, finding.claim)
    return [*made, table]


def _markdown_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def to_markdown(result: Reproduction) -> str:
    """Every table of one paper."""
    text = [f"# {result.paper}, reproduced\n", f"{_caption(result)}.\n"]
    for name, cells in result.tables.items():
        text += [f"## {_title(result, name)}\n", _markdown_table(HEADS, [_words(cell) for cell in cells])]
    rows = [(finding.name, finding.value, finding.claim) for finding in result.findings]
    text += ["## Beyond the tables\n", _markdown_table(("what", "found", "the paper says"), rows)]
    return "\n".join(text)


def summary_markdown(results: Sequence[Reproduction]) -> str:
    """A short table: how many published cells lie inside, and which do not."""
    rows = []
    for result in results:
        for name, (inside, total) in result.count().items():
            outside = [
                "{} {} {} (ours {})".format(*_words(cell))
                for cell in result.tables[name]
                if cell.verdict == "outside"
            ]
            rows.append((result.paper, name, f"{inside} of {total}", "; ".join(outside) or "none"))
    return _markdown_table(("paper", "table", "cells inside", "cells outside"), rows)


def to_json(result: Reproduction) -> dict[str, Any]:
    """Everything but the recordings."""
    return {
        "paper": result.paper,
        "runs": result.runs,
        "seed": result.seed,
        "cells": [cell.as_json() for cell in result.cells],
        "findings": [vars(finding) for finding in result.findings],
    }
