"""The circles of a glider's flight log: side, turns, wind, climb, and when a live decider stated
them.
"""

from pathlib import Path
from typing import Any

import numpy as np

from agents.evaluation.cells import filled_table
from agents.evaluation.gliders import Setting, glider_statements
from agents.figures.tracks import recording_figure, runs
from agents.interface.output_files import atomic_folder, write_files, write_table
from agents.recordings.command import Report
from baselines.recordings.flights.circling import AirMotion, air_motion, circles
from baselines.recordings.flights.flight import LONGEST_STEP, Flight
from baselines.recordings.flights.gliders import glider_flight
from baselines.recordings.flights.labels import MODE_NAMES
from baselines.recordings.reading.igc import DAY, IgcLog
from baselines.rules.circling import GliderClimb
from hybrid_env.checks import ArgumentError, IntArray

MAX_PRINTED = 40
LIVE = Setting(GliderClimb.name, 0, GliderClimb.usual)

HEADS = {
    "circle": ("circle", "d"),
    "begin_utc": ("UTC", "s"),
    "seconds": ("s", ".0f"),
    "side": ("side", "s"),
    "turns": ("turns", ".1f"),
    "wind": ("wind\nm/s", ".1f"),
    "wind_from": ("from\ndeg", ".0f"),
    "climb": ("climb\nm/s", ".1f"),
    "gain": ("gain\nm", ".0f"),
    "stated_after": ("stated\nafter s", ".0f"),
}
"""Columns of circles.csv, with heads and formats in the printed table."""


def track_glider(name: str, log: IgcLog, folder: Path, picture: bool) -> Report:
    """Find the circles of a log, write circles.csv and track.png, and return what is printed."""
    flight = glider_flight(name, "", log)
    if not flight.pieces:
        raise ArgumentError(
            f"{name} has no 20 positions without a gap of a minute: expected a flight"
        )
    (motion,) = air_motion([flight])
    modes, _ = circles(flight, motion.rates)
    # A gap ends a circle.
    begins = [first for first, _ in flight.pieces]
    stated = glider_statements([flight], [LIVE])[LIVE][0]
    rows = [
        (number, *circle_row(flight, motion, stated, float(log.times[0]), *run))
        for number, run in enumerate((run for run in runs(modes, begins) if run[2]), start=1)
    ]
    columns = {column: [row[k] for row in rows] for k, column in enumerate(HEADS)}
    files = ["circles.csv", "track.png"][: 1 + picture]
    with atomic_folder("out", folder) as part:
        write_table(part / files[0], columns)
        if picture:
            figure = recording_figure(
                flight.positions / 1000.0,
                flight.times / 60.0,
                flight.pieces,
                modes,
                {GliderClimb.title: stated},
                MODE_NAMES,
                f"{name}: circles",
                "hindsight",
            )
            write_files(part, {files[1]: figure})
    shown = [
        [
            "" if cell == "" else f"{cell:{form}}"
            for cell, (_, form) in zip(row, HEADS.values(), strict=True)
        ]
        for row in rows[:MAX_PRINTED]
    ]
    more = (
        f"... and {len(rows) - MAX_PRINTED} more in circles.csv" if len(rows) > MAX_PRINTED else ""
    )
    seconds = sum(
        float(flight.times[end - 1] - flight.times[first]) for first, end in flight.pieces
    )
    circling = (
        f"{len(rows)} times circling, {np.mean(modes != 0):.0%} of the time,"
        f" {sum(columns['turns']):.0f} turns"
    )
    lines = [
        f"{name}: {seconds / 3600.0:.2f} h, {circling}",
        *(f"{name}: {note}" for note in log.notes),
    ]
    gaps = np.diff(flight.times)[np.diff(flight.times) > LONGEST_STEP]
    if gaps.size:
        lines.append(
            f"{name}: gaps of more than a minute, or steps of the clock, which end a circle:"
            f" {gaps.size}, up to {gaps.max():,.0f} s"
        )
    table = filled_table("Circles", [head for head, _ in HEADS.values()], shown, more)
    return Report(tuple(lines), table, tuple(folder / file for file in files))


def circle_row(
    flight: Flight,
    motion: AirMotion,
    stated: IntArray,
    start: float,
    first: int,
    end: int,
    mode: int,
) -> tuple[Any, ...]:
    """Return the cells of circles.csv after the number, for rows from `first` to `end` to one side.

    The statements (n,) are of a live decider; the flight starts at `start` [s after midnight UTC].
    """
    times, rows = flight.times[first:end] - flight.times[first], slice(first, end)
    seconds, wind = float(times[-1]), motion.wind[rows].mean(0)
    turned = float((motion.rates[first : end - 1] * np.diff(times)).sum())
    whole = int((start + flight.times[first]) % DAY)
    gain = (
        0.0 if flight.altitudes is None else float(np.diff(flight.altitudes[[first, end - 1]])[0])
    )
    known = np.flatnonzero(stated[rows] == mode)
    return (
        f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}",
        seconds,
        MODE_NAMES[mode],
        round(abs(turned) / (2.0 * np.pi), 2),
        round(float(np.hypot(*wind)), 2),
        round(float(np.degrees(np.arctan2(*-wind))) % 360.0),
        round(gain / max(seconds, 1.0), 2),
        round(gain),
        float(times[known[0]]) if known.size else "",
    )
