"""What is shown of a comparison on flights of gliders: figures, tables and a picture."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.flights.figure import flight_figure
from studies.flights.labels import MODE_NAMES, Pair, spans
from studies.flights.scores import cell, estimates, figures, value
from studies.flights.turns import STRAIGHT, FloatArray
from studies.gliders.study import LEVELS, GliderComparison, find_rule

SHARES = (5.0, 50.0, 95.0)
"""Percentiles of what recorded and simulated flights have in common."""


def as_json(result: GliderComparison) -> dict[str, Any]:
    """Return settings and figures of every group, and percentiles as plain values."""
    groups = {
        group: {
            f"{level:g}": {
                name: figures(result.at(level), name, rows)
                | {"settings": rule.chosen[level], "simulated": estimates(rule.simulated[level])}
                for name, rule in result.rules.items()
            }
            for level in LEVELS
        }
        for group, rows in result.groups.items()
    }
    rows = result.groups["both halves"]
    logs, copies = (
        {name: np.percentile(values, SHARES).tolist() for name, values in samples(pairs).items()}
        for pairs in ([result.flights[k] for k in rows], result.copies)
    )
    gap = {name: (logs[name], copies[name]) for name in logs}
    return {
        "groups": groups,
        "gap": gap,
    }


def samples(pairs: Sequence[Pair], inner: int = 3) -> dict[str, FloatArray]:
    """Return values by quantity, with its unit, where flights are scored; `inner` positions at
    either end of circles are left out.
    """
    rates = []
    changes = []
    for _, label in pairs:
        straight = label.scored & (label.modes == STRAIGHT)
        changes.append(np.abs(np.gradient(label.speeds, label.times))[straight])
        # Of every time of circling.
        for first, end, mode in spans(label.modes, [(0, len(label.modes))]):
            circle = label.rates[first + inner : end - inner]
            if mode != STRAIGHT and label.scored[first:end].any() and circle.size > inner:
                rates.append(np.median(np.degrees(np.abs(circle))))
    return {
        "circling: turn rate, deg/s": np.array(rates),
        "straight: its change, m/s²": np.concatenate(changes),
    }


def tables(result: GliderComparison, content: dict[str, Any]) -> dict[str, pd.DataFrame]:
    """Return the tables of each level, for the open logs and for the sealed ones, and of the
    simulated flights, by their titles; `content` is that of `as_json`.
    """
    frames = {}
    for group, rows in result.groups.items():
        hours = sum(float(result.flights[k][1].weights.sum()) for k in rows) / 3600.0
        for level, of_level in content["groups"][group].items():
            title = f"{len(rows)} flights of gliders, {group}, {hours:.1f} h: at most {level}/h"
            frames[title] = pd.DataFrame(
                {
                    "decider": find_rule(name).title,
                    "false/h": cell(of_rule["false_per_hour"]),
                    "enter, s": cell(of_rule["enter"]),
                    "leave, s": cell(of_rule["leave"]),
                    "missed in, %": f"{100.0 * of_rule['misses_in']['value']:.1f}",
                    "out, %": f"{100.0 * of_rule['misses_out']['value']:.1f}",
                    "agreement": cell(of_rule["agreement"], 3),
                    "less first, points": cell(of_rule["agreement_less_first"], 1, 100.0),
                    "simulated": f"{of_rule['simulated']['agreement']['value']:.3f}",
                }
                for name, of_rule in of_level.items()
            )
    frames["Percentiles of the open logs and of simulated flights"] = pd.DataFrame(
        {
            "quantity": name,
            "logs": "  ".join(f"{number:.2f}" for number in logs),
            "simulated": "  ".join(f"{number:.2f}" for number in copies),
        }
        for name, (logs, copies) in content["gap"].items()
    )
    return frames


def picture(result: GliderComparison, seconds: float = 600.0) -> Figure:
    """Draw the time [s] with most changes of the flight with the median agreement of the first
    rule.
    """
    name, scores = next(iter(result.at(LEVELS[1]).items()))
    each = [value(scores.some([k])) for k in range(len(result.flights))]
    k = int(np.argsort(each)[len(each) // 2])
    flight, labels = result.flights[k]
    ends = np.searchsorted(flight.times, flight.times + seconds)
    # Number of changes of the label in the time that begins at each position.
    changes = np.cumsum(
        np.diff(
            labels.modes,
            prepend=labels.modes[0],
        )
        != 0
    )
    first = int((changes[ends - 1] - changes).argmax())
    rows = slice(first, int(ends[first]))
    return flight_figure(
        replace(
            flight,
            times=flight.times[rows] - flight.times[first],
            positions=flight.positions[rows],
        ),
        np.where(
            labels.scored,
            labels.modes,
            len(MODE_NAMES),
        )[rows],
        {find_rule(rule).title: results.stated[k][rows] for rule, results in result.rules.items()},
        f"{flight.identity}: {find_rule(name).title} agrees {each[k]:.1%} of the whole flight",
    )
