"""The figures of deciders of `HybridTrackQuickest-v0` as a table: delay, wrong changes and reward."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich import box
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import estimate_cell
from agents.evaluation.operating_curve import Estimate
from agents.evaluation.statement_curve import (
    CHANGE_RATIO,
    FULL_DELAY,
    MEAN_DELAY,
    MISSED_SHARE,
    REWARD,
    RIGHT,
    WRONG_CHANGES,
    StatementCurve,
    mean_of,
)

STATISTICS = {
    "reward": mean_of(REWARD),
    "right": mean_of(RIGHT),
    "delay": MEAN_DELAY,
    "missed": MISSED_SHARE,
    "full_delay": FULL_DELAY,
    "wrong_changes": mean_of(WRONG_CHANGES),
    "change_ratio": CHANGE_RATIO,
}
"""Figures by name: mean reward of a tick; share of right ticks; mean delay of the detected switches [ticks];
share of missed switches; mean delay of all switches [ticks]; wrong changes per 1,000 ticks; changes of the
statement per switch."""
QUANTILES = (0.5, 0.9)
CAPTION = """± half width of the 95 % confidence interval over tracks.
delay: ticks from a switch to the first right statement; 50 and 90 % quantiles.
missed: switches followed by another one before the new mode was stated.
delay, all: a switch that is not detected counts until the end of its segment.
wrong: changes of the statement to a wrong mode per 1,000 ticks.
changes: of the statement, per switch."""


@dataclass(frozen=True)
class StatementFigures:
    """Figures of one decider at one threshold.

    Attributes:
        name: of the decider.
        symbol: of its threshold.
        threshold: the threshold.
        estimates: figures with the keys of `STATISTICS`.
        quantiles: of the delays of the detected switches [ticks], for `QUANTILES`; NaN without any.
    """

    name: str
    symbol: str
    threshold: float
    estimates: dict[str, Estimate]
    quantiles: tuple[float, ...]

    def as_json(self) -> dict[str, Any]:
        """Return name, threshold and figures; None where a figure is undefined."""
        return {
            "name": self.name,
            "threshold": {"symbol": self.symbol, "value": self.threshold},
            **{name: estimate.as_json() for name, estimate in self.estimates.items()},
            "delay_quantiles": {
                f"{level:g}": ticks if np.isfinite(ticks) else None
                for level, ticks in zip(QUANTILES, self.quantiles, strict=True)
            },
        }


def statement_figures(curve: StatementCurve) -> StatementFigures:
    """Return the figures of a curve of a single threshold."""
    delays = curve.metrics[0].delays
    quantiles = np.quantile(delays, QUANTILES).tolist() if delays.size else [np.nan] * len(QUANTILES)
    estimates = {name: curve.estimate(statistic) for name, statistic in STATISTICS.items()}
    family = curve.family
    return StatementFigures(family.name, family.symbol, family.thresholds[0], estimates, tuple(quantiles))


def statement_table(
    figures: Sequence[StatementFigures],
    title: str,
    caption: str,
    differences: Sequence[Estimate | None],
    to: str,
) -> Table:
    """Return a table with one row for each decider.

    Args:
        figures: of the deciders.
        title: of the table.
        caption: lines before the explanation of the columns, each with its end.
        differences: of the mean reward of a tick to that of another decider; None for this one.
        to: name of the other decider.
    """
    compared = any(difference is not None for difference in differences)
    if compared:
        caption += f"diff.: reward of a tick less that of {to} on the same tracks.\n"
    table = Table(
        title=escape(title),
        min_width=len(title),
        caption=escape(caption + CAPTION),
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        padding=0,
    )
    heads = (
        "reward", "right\n%", "delay\nmean", "50 %\n90 %", "missed\n%", "delay,\nall", "wrong\n/1000",
        "changes",
    )  # fmt: skip
    table.add_column("decider", min_width=16, overflow="fold")  # long names are wrapped, numbers are not
    for head in heads:
        table.add_column(head, justify="right", no_wrap=True)
    if compared:
        table.add_column("reward\ndiff.", justify="right", no_wrap=True)
    for one, difference in zip(figures, differences, strict=True):
        estimates = one.estimates
        middle, high = (f"{ticks:.0f}" if np.isfinite(ticks) else "-" for ticks in one.quantiles)
        cells = [
            _cell(estimates["reward"], 1, 4), _cell(estimates["right"], 100, 1),
            _cell(estimates["delay"], 1, 1), f"{middle}\n{high}",
            _cell(estimates["missed"], 100, 1), _cell(estimates["full_delay"], 1, 1),
            _cell(estimates["wrong_changes"], 1, 2), _cell(estimates["change_ratio"], 1, 2),
        ]  # fmt: skip
        if compared:
            cells.append("" if difference is None else _cell(difference, 1, 4, "+"))
        table.add_row(f"{escape(one.name)}\n[bright_black]{one.symbol} {one.threshold:g}[/]", *cells)
    return table


def _cell(estimate: Estimate, scale: float, digits: int, sign: str = "") -> str:
    return estimate_cell(estimate, scale, digits, "-", sign)
