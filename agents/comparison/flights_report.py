"""Tables and JSON of the comparison on recorded flights."""

from typing import Any

import numpy as np
from rich import box
from rich.markup import escape
from rich.table import Table

from agents.comparison.flights_late import POSITIONS_LATE
from agents.comparison.flights_study import FlightComparison
from baselines.recordings.flights.metrics import FlightFigures, figures

COLUMNS = {
    "agreement": ("agreement", 3, 1.0),
    "delay": ("delay\ns", 1, 1.0),
    "misses": ("misses\n%", 1, 100.0),
    "false_per_hour": ("false/h\n(turns)", 1, 1.0),
    "changes_per_label": ("changes\nper label", 2, 1.0),
}
"""Heading, digits and scale of each figure of the table."""


def flights_table(result: FlightComparison) -> Table:
    """Figures of each decider in each tier, with 95 % intervals over flights."""
    counts = next(iter(result.counts.values()))
    hours = sum(counts[k].scored for k in result.counted) / 3600.0
    form = "" if result.plan.form == "native" else f", {result.plan.form}"
    table = _table(
        f"{len(result.counted)} recorded flights{form}, {hours:.1f} scored hours",
        "Second lines: 95 % interval, flights drawn with replacement.\n"
        "Twins: agreement on simulated flights with the same steps, speeds and turns.\n"
        "Delay: from a change of the label to the first right statement.\n"
        "False: a change to a mode that is not the label until the next change;\n"
        "in brackets those of them to a turn while the label is straight motion.",
    )
    table.add_column("tier")
    table.add_column("decider", min_width=9, overflow="fold")
    for head, *_ in COLUMNS.values():
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("twins", justify="right", no_wrap=True)
    for name, rows in result.groups.items():
        for number, (decider, label) in enumerate(result.plan.labels.items()):
            group = result.group(decider, name)
            cells = []
            for key, (_, digits, scale) in COLUMNS.items():
                shown = [
                    _short(scale * one, digits)
                    for one in (getattr(group.figures, key), *group.intervals[key])
                ]
                turns = ""
                if key == "false_per_hour":
                    turns = f" ({_short(group.figures.false_turns_per_hour, digits)})"
                cells.append(f"{shown[0]}{turns}\n{shown[1]}-{shown[2]}")
            head = f"{name}\n({len(rows)})" if number == 0 else ""
            table.add_row(head, escape(label), *cells, f"{group.twin.agreement:.3f}")
        table.add_section()
    return table


def sensitivity_table(result: FlightComparison) -> Table:
    """Effect of the settings of the labels."""
    table = _table(
        "Labels with other settings",
        "same: share of the time with the label as used, where both are scored.",
    )
    table.add_column("setting")
    decider = next(iter(result.plan.labels.values()))
    for head in ("same", "scored", "turns", f"agreement of\n{escape(decider)}"):
        table.add_column(head, justify="right")
    for one in result.sensitivity:
        table.add_row(
            one.name, f"{one.same:.3f}", f"{one.scored:.3f}", f"{one.turns}", f"{one.agreement:.3f}"
        )
    return table


def differences_table(result: FlightComparison) -> Table:
    """Paired differences of the agreement to the first decider."""
    first, *others = result.plan.labels.items()
    table = _table(
        f"Agreement less that of {escape(first[1])}, percentage points",
        "Second lines: 95 % interval, flights drawn with replacement.",
    )
    table.add_column("tier")
    for _, label in others:
        table.add_column(escape(label), justify="right", min_width=12)
    for name in result.groups:
        cells = []
        for decider, _ in others:
            value, (low, high) = result.difference(decider, name)
            cells.append(f"{100.0 * value:+.1f}\n{100.0 * low:.1f}, {100.0 * high:.1f}")
        table.add_row(name, *cells)
    return table


def late_table(result: FlightComparison) -> Table:
    """Figures of the labels, stated late."""
    table = _table(
        "The labels themselves, stated late",
        "Late: figures of a decider that states labels so many positions late.\n"
        "Truth: share of the time in which labels of twins are the true modes.",
    )
    table.add_column("tier")
    table.add_column("truth", justify="right")
    for count in POSITIONS_LATE:
        table.add_column(f"{count} late:\nagreement", justify="right")
        table.add_column("delay\ns", justify="right")
        table.add_column("false\nper hour", justify="right")
    for one in result.late_labels:
        cells = [
            text
            for late in one.late
            for text in (f"{late.agreement:.3f}", f"{late.delay:.1f}", f"{late.false_per_hour:.1f}")
        ]
        table.add_row(one.tier, f"{one.truth:.3f}", *cells)
    return table


def _table(title: str, caption: str) -> Table:
    return Table(
        title=title, caption=caption, caption_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )


def flights_json(result: FlightComparison) -> dict[str, Any]:
    """Contents of the tables, and the figures of every flight."""
    return {
        "source": str(result.plan.source) if result.plan.source else "package traffic",
        "form": result.plan.form,
        "tiers": {
            name: {decider: _group_json(result, decider, name) for decider in result.plan.labels}
            for name in result.groups
        },
        "labels": [one._asdict() for one in result.sensitivity],
        "late_labels": [
            {
                "tier": one.tier,
                "truth": one.truth,
                "late": {
                    str(count): _figures_json(late)
                    for count, late in zip(POSITIONS_LATE, one.late, strict=True)
                },
            }
            for one in result.late_labels
        ],
        "flights": [
            {
                "id": flight.identity,
                "tier": flight.tier.name,
                "hours": flight.hours,
                "positions": len(flight.times),
                "repeated": flight.repeated,
                "interpolated": flight.interpolated,
                "scored": float(np.mean(labels.scored)),
                "turns": sum(mode != 0 for *_, mode in labels.pieces),
                "deciders": {
                    decider: _figures_json(figures([result.counts[decider][k]]))
                    for decider in result.plan.labels
                },
            }
            for k, (flight, labels) in enumerate(zip(result.flights, result.labels, strict=True))
        ],
    }


def _group_json(result: FlightComparison, decider: str, name: str) -> dict[str, Any]:
    group = result.group(decider, name)
    found: dict[str, Any] = _figures_json(group.figures) | {
        "intervals": {key: [_number(low), _number(high)] for key, (low, high) in group.intervals.items()},
        "twins": _figures_json(group.twin),
    }
    if decider != next(iter(result.plan.labels)):
        value, interval = result.difference(decider, name)
        found["agreement_less_first"] = {
            "value": _number(value), "interval": [_number(one) for one in interval]
        }  # fmt: skip
    return found


def _short(value: float, digits: int) -> str:
    """Return a number with one digit less from 10 on."""
    return f"{value:.{digits - (round(abs(value), digits) >= 10.0)}f}"


def _figures_json(values: FlightFigures) -> dict[str, float | None]:
    return {name: _number(value) for name, value in values._asdict().items()}


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
