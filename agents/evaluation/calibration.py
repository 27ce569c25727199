"""Calibration of the posterior of a filter bank: what it states, and how often it is right."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.table import Table

from agents.evaluation.cells import new_table
from baselines.rules.posterior_paths import MIN_COUNT, simulate_posterior_paths, summarise_calibration

CALIBRATION_TICKS = (2, 5, 10, 20, 40)


def calibration_rows(episodes: int, seed: int, options: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the calibration of the bank's posterior after numbers of ticks without a decision.

    The keys of a row are "ticks", "right" (accuracy of the most probable hypothesis or type), "stated" (its
    mean posterior) and "worst" (the largest calibration error: posterior minus accuracy in a bin; None
    without a bin of enough segments).

    Args:
        episodes: number of simulated episodes.
        seed: of the first episode.
        options: of the environment.
    """
    paths = simulate_posterior_paths(episodes, seed, max(CALIBRATION_TICKS), **options)
    rows = [
        {"ticks": tick, **asdict(summarise_calibration(paths, tick))}
        for tick in CALIBRATION_TICKS
        if (paths.length >= tick).any()
    ]
    return [{name: value if np.isfinite(value) else None for name, value in row.items()} for row in rows]


def calibration_table(rows: Sequence[Mapping[str, Any]], bank: str) -> Table:
    """Return a table of `calibration_rows` of a bank."""
    table = new_table(
        f"Calibration of the {bank.replace('_', '-')} bank (no decisions)",
        f"Calibration error: mean posterior minus accuracy,\nin bins of at least {MIN_COUNT:,} segments.",
    )
    for head in ("ticks", "accuracy\n%", "mean\nposterior, %", "largest calibration\nerror, %"):
        table.add_column(head, justify="right")
    for row in rows:
        worst = "-" if row["worst"] is None else f"{100 * row['worst']:+.1f}"
        table.add_row(f"{row['ticks']:g}", f"{100 * row['right']:.1f}", f"{100 * row['stated']:.1f}", worst)
    return table
