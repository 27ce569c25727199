"""What recorded and simulated flights of gliders have in common, and in what they differ."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.table import Table

from agents.evaluation.cells import filled_table
from agents.evaluation.gliders import MARGIN, PART
from baselines.estimation.turns import STRAIGHT, run_turn_imm
from baselines.recordings.flights.flight import Flight, stack_flights
from baselines.recordings.flights.labels import Labels
from baselines.rules.circling import GliderImm
from hybrid_env.checks import FloatArray

SHARES = (5.0, 50.0, 95.0)  # percentiles
SLOWEST_WIGGLE, SMALLEST_WIGGLE = np.radians(1.0), 10.0  # turn rate [rad/s] and angle [deg]
INNER = 3  # positions of circles that are left out at either end


def samples(flights: Sequence[Flight], labels: Sequence[Labels]) -> dict[str, FloatArray]:
    """Return values by quantity, with its unit, where flights are scored."""
    batch = stack_flights(flights, PART, MARGIN)
    innovations = batch.unstack(run_turn_imm(batch, GliderImm.models[0]).innovations, [len(f.times) for f in flights])
    found: dict[str, list[Any]] = {}
    for flight, label, innovation in zip(flights, labels, innovations, strict=True):
        straight, circling = (label.scored & ((label.modes == STRAIGHT) == own) for own in (True, False))
        rates, changes = np.degrees(np.abs(label.rates)), np.abs(np.gradient(label.speeds, label.times))
        for name, rows in (("straight", straight), ("circling", circling)):
            for what, values in (
                ("airspeed, m/s", label.speeds), ("its change, m/s²", changes), ("climb rate, m/s", flight.climbs),
                ("innovation along", np.abs(innovation[:, 0])), ("innovation across", np.abs(innovation[:, 1])),
            ):  # fmt: skip
                found.setdefault(f"{name}: {what}", []).append(values[rows])
        found.setdefault("straight: turn rate, deg/s", []).append(rates[straight])
        found.setdefault("wiggle: angle, deg", []).append(_wiggles(label, straight))
        for first, end, mode in label.pieces:
            if label.scored[first:end].any():
                name, inner = "straight" if mode == STRAIGHT else "circling", rates[first + INNER : end - INNER]
                found.setdefault(f"{name}: duration, s", []).append([label.times[end - 1] - label.times[first]])
                if mode != STRAIGHT and inner.size > INNER:
                    found.setdefault("circling: turn rate, deg/s", []).append([np.median(inner)])
                    found.setdefault("circling: its variation", []).append([inner.std() / inner.mean()])
    return {name: np.concatenate(values) for name, values in sorted(found.items())}


def _wiggles(label: Labels, straight: Any) -> FloatArray:
    """Return the angles of turns to one side in straight flight [deg]."""
    turning = np.where(straight & (np.abs(label.rates) > SLOWEST_WIGGLE), np.sign(label.rates), 0.0)
    begins = np.flatnonzero(np.diff(turning, prepend=np.nan) != 0.0)
    angles = np.add.reduceat(np.degrees(np.abs(label.rates)) * label.weights * (turning != 0.0), begins)
    return np.asarray(angles[angles > SMALLEST_WIGGLE])


def percentiles(values: FloatArray) -> list[float]:
    """Return the percentiles of values."""
    return [float(one) for one in np.percentile(values, SHARES)]


def gap_table(gap: dict[str, tuple[list[float], list[float]]]) -> Table:
    """Return the table of percentiles, of logs and of simulated flights."""
    lines = [(name, *(f"{one:.2f}" for side in sides for one in side)) for name, sides in gap.items()]
    heads = ("", *(f"{source}\n{share:g} %" for source in ("logs", "simul.") for share in SHARES))
    return filled_table("Open logs and simulated flights: percentiles", heads, lines)
