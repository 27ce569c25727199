"""What is shown of a comparison on flights of gliders: tables and a picture."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.flights.figure import flight_figure
from studies.flights.labels import Pair, spans
from studies.flights.scores import estimates, estimates_beside_first, table, value
from studies.flights.turns import STRAIGHT, FloatArray
from studies.gliders.logs import SEALED
from studies.gliders.study import LEVELS, RuleResults


def report(
    flights: Sequence[Pair], copies: Sequence[Pair], rules: Mapping[str, RuleResults]
) -> tuple[str, dict[str, Any]]:
    """Return the tables of each level, for the open logs and for the sealed ones, and of the
    simulated flights; and settings, statistics and percentiles.
    """
    groups: dict[str, list[int]] = {}
    for k, (flight, _) in enumerate(flights):
        group = SEALED if flight.tier.name == SEALED else "both halves"
        groups.setdefault(group, []).append(k)
    content: dict[str, Any] = {group: {} for group in groups}
    texts = []
    for group, rows in groups.items():
        hours = sum(float(flights[k][1].weights.sum()) for k in rows) / 3600.0
        for level in LEVELS:
            scores = {name: results.scores[level] for name, results in rules.items()}
            of_level: dict[str, Any] = {}
            content[group][f"{level:g}"] = of_level
            for name, results in rules.items():
                simulated = estimates(results.simulated[level])
                others = {"settings": results.chosen[level], "simulated": simulated}
                of_level[name] = estimates_beside_first(scores, name, rows) | others
            title = f"{len(rows)} flights of gliders, {group}, {hours:.1f} h: at most {level:g}/h"
            texts.append(table(title, of_level))
    logs, copied = (
        {name: np.percentile(values, (5.0, 50.0, 95.0)).tolist() for name, values in parts.items()}
        for parts in map(samples, ([flights[k] for k in groups["both halves"]], copies))
    )
    gap = {name: (logs[name], copied[name]) for name in logs}
    frame = pd.DataFrame(gap, index=["logs", "simulated"]).T
    texts.append(f"Percentiles: 5, 50 and 95 %\n{frame.to_string()}\n")
    return "\n".join(texts), {"groups": content, "gap": gap}


def samples(pairs: Sequence[Pair], inner: int = 3) -> dict[str, FloatArray]:
    """Return values by quantity, with its unit, where flights are scored; `inner` positions at
    either end of circles are left out.
    """
    rates = []
    changes = []
    for _, label in pairs:
        straight = label.scored & (label.modes == STRAIGHT)
        changes.append(np.abs(np.gradient(label.speeds, label.times))[straight])
        # Figures of every time of circling.
        for rows, mode in spans(label.modes, [slice(0, len(label.modes))]):
            circle = label.rates[rows][inner:-inner]
            if mode != STRAIGHT and label.scored[rows].any() and circle.size > inner:
                rates.append(np.median(np.degrees(np.abs(circle))))
    return {
        "circling: turn rate, deg/s": np.array(rates),
        "straight: its change, m/s²": np.concatenate(changes),
    }


def picture(
    flights: Sequence[Pair], rules: Mapping[str, RuleResults], seconds: float = 600.0
) -> Figure:
    """Draw the time [s] from the first circle of the flight with the median agreement of the first
    rule.
    """
    name, results = next(iter(rules.items()))
    each = [value(results.scores[LEVELS[1]].some([k])) for k in range(len(flights))]
    k = int(np.argsort(each)[len(each) // 2])
    flight, labels = flights[k]
    times = flight.times - flight.times[(labels.modes != STRAIGHT).argmax()]
    rows = (times >= 0.0) & (times < seconds)
    return flight_figure(
        replace(flight, times=times[rows], positions=flight.positions[rows]),
        labels.shown[rows],
        {rule: results.stated[k][rows] for rule, results in rules.items()},
        f"{flight.identity}: {name} agrees {each[k]:.1%} of the whole flight",
    )
