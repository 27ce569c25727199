"""The figures of the limits: what each shows of the results; `agents.figures` draws it."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import DeciderStyle, decider_styles
from agents.studies.limits import (
    BANKS,
    BEAM,
    GEOMETRIC,
    IMM,
    LATER,
    LAWS,
    NOISE_LEVELS,
    THRESHOLD,
    TIMES,
    Limit,
)
from baselines.scoring.scores import mean

WIDTH = 11.5  # of a figure [in]
NAMES = {
    IMM: "IMM",
    THRESHOLD: "IMM threshold",
    GEOMETRIC: "beam, geometric",
    BEAM: "beam",
}
"""Labels, which are the names of the deciders in other figures."""


def limits_figure(parts: Mapping[str, Sequence[Any]]) -> Figure:
    """Return the figure of a study, see `limits.calls`."""
    return decision_times(parts["rules"]) if "rules" in parts else later_ticks(parts["steps"])


def decision_times(found: Sequence[Limit]) -> Figure:
    """Mean decision time at 98 % accuracy over the noise, one row per environment, one column per bank.

    Rules that do not reach 98 % at a noise level have a hollow marker in the strip at the top.
    """
    places = list(dict.fromkeys(one.place for one in found))
    noise = Axis(
        "measurement variance R, m²",
        (0.7 * NOISE_LEVELS[0], 1.5 * NOISE_LEVELS[-1]),
        {noise: f"{noise:g}" for noise in NOISE_LEVELS},
        log=True,
    )
    styles = decider_styles(dict.fromkeys(one.row for one in found))
    rows = []
    for place in places:
        results = [one for one in found if one.place == place]
        times = [time for time in map(_time, results) if np.isfinite(time)]
        top = 5.0 * float(np.ceil(max(times, default=10.0) / 5.0))
        ticks = {tick: f"{tick:g}" for tick in np.arange(0, top + 1, 10).tolist()}
        time = Axis(
            "mean decision time\nat 98 % accuracy, ticks",
            (0.0, 1.15 * top),
            ticks | {1.09 * top: "not reached"},
            minor=True,
        )
        strip = 1.03 * top, 1.09 * top
        name = place.rpartition(":")[2]
        rows.append(
            [
                Panel(f"{name}, {bank.replace('_', '-')} bank", noise, time, curves, strip)
                for bank, curves in _bank_curves(results, styles).items()
            ]
        )
    return curve_figure(rows, (WIDTH, 3.9 * len(places)), title_size=11.0, sharex=True, sharey="row")


def _time(one: Limit) -> float:
    """Mean decision time at 98 % accuracy, infinite where it is not reached."""
    assert one.curve is not None
    return one.curve.estimate(TIMES["time_98"]).value


def _bank_curves(found: Sequence[Limit], styles: Mapping[str, DeciderStyle]) -> dict[str, list[Curve]]:
    """Return the curves of each bank. Coinciding lines remain visible, as the last is dashed."""
    rules = list(dict.fromkeys(one.row for one in found))
    curves: dict[str, list[Curve]] = {bank: [] for bank in BANKS}
    for bank, (index, rule) in itertools.product(BANKS, enumerate(rules)):
        own = [one for one in found if (one.bank, one.row) == (bank, rule)]
        curves[bank].append(
            Curve(
                rule,
                styles[rule],
                [one.noise for one in own],
                [_time(one) for one in own],
                size=8.5 - 1.3 * index,
                filled=True,
                width=1.8,
                dashes="--" if rule == rules[-1] else "-",
            )
        )
    return curves


def later_ticks(found: Sequence[Limit]) -> Figure:
    """Mean reward of a tick against the later ticks known, one row per law, one column per noise level.

    The curve of the beam that knows the law begins with its reward on line. The other lines are the rules
    below it, dotted without a threshold. Bars are 95 % confidence intervals.
    """
    rows = [
        [
            Panel(
                f"durations {law}, R = {noise:g} m²",
                Axis("later ticks known"),
                Axis("mean reward of a tick"),
                _step_curves({one.row: one for one in found if (one.place, one.noise) == (law, noise)}),
            )
            for noise in NOISE_LEVELS
        ]
        for law in LAWS
    ]
    return curve_figure(rows, (WIDTH, 3.7 * len(LAWS)), title_size=10.0, sharex=True, sharey=True)


def _step_curves(steps: dict[str, Limit]) -> list[Curve]:
    """Return the curves of one law and noise level."""
    styles = decider_styles(NAMES.values())
    lags = [0, *LATER]
    rewards = [steps[step].scores.estimate(mean("reward")) for step in (BEAM, *LATER.values())]
    points = np.array([[one.value, one.low, one.high] for one in rewards]).T
    bars = np.abs(points[1:] - points[0])
    curves = [
        Curve(NAMES[BEAM], styles[NAMES[BEAM]], lags, points[0], bars=bars, size=5.0, filled=True, width=1.5)
    ]
    for step in (GEOMETRIC, THRESHOLD, IMM):
        style = styles[NAMES[THRESHOLD if step == IMM else step]]  # the same bank
        reward = float(steps[step].scores.curve(mean("reward"))[0])
        dashes = ":" if step == IMM else "--"
        curves.append(Curve(NAMES[step], style, [lags[0], lags[-1]], [reward] * 2, size=0.0, dashes=dashes))
    return curves
