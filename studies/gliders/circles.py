"""The circles of a glider's flight log, `python -m studies.gliders.circles`: side, turns, wind,
climb, and when a live decider stated them.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import tyro
from matplotlib.figure import Figure

from agents import run_command
from baselines import IgcLog, parse_igc
from hybrid_env import ArgumentError
from studies.flights.figure import flight_figure
from studies.flights.flight import LONGEST_STEP
from studies.flights.labels import MODE_NAMES, spans
from studies.flights.turns import STRAIGHT
from studies.gliders.circling import air_motion, circles
from studies.gliders.logs import glider_flight
from studies.gliders.study import Setting, find_rule, glider_statements


def find_circles(name: str, log: IgcLog) -> tuple[pd.DataFrame, list[str], Figure]:
    """Return a row for each time of circling to one side, notes on the log, and a figure.

    Raises:
        ArgumentError: the log has no flight.
    """
    flight = glider_flight(name, "", log)
    if not flight.pieces:
        raise ArgumentError(f"{name}: expected a flight of 20 positions without a gap of a minute")
    (motion,) = air_motion([flight])
    modes, _ = circles(flight, motion.rates)
    # With about five false changes an hour on the open logs.
    live = Setting("imm-climb", 0, (0.95, 0.9))
    (stated,) = glider_statements([flight], [live])[live]
    assert flight.altitudes is not None
    rows = []
    # A gap ends a circle.
    for first, end, mode in spans(modes, flight.pieces):
        if mode == STRAIGHT:
            continue
        part = slice(first, end)
        times = flight.times[part] - flight.times[first]
        wind = motion.wind[part].mean(0)
        turned = float((motion.rates[part][:-1] * np.diff(times)).sum())
        gain = float(flight.altitudes[end - 1] - flight.altitudes[first])
        known = np.flatnonzero(stated[part] == mode)
        # Of a day.
        start = (log.times[0] + flight.times[first]) % 86400.0
        rows.append(
            {
                "begin_utc": str(pd.to_timedelta(start, "s").floor("s"))[-8:],
                "seconds": times[-1],
                "side": MODE_NAMES[mode],
                "turns": round(abs(turned) / (2.0 * np.pi), 2),
                "wind": round(float(np.hypot(*wind)), 2),
                "wind_from": round(float(np.degrees(np.arctan2(*-wind))) % 360.0),
                "climb": round(gain / max(times[-1], 1.0), 2),
                "gain": round(gain),
                "stated_after": times[known[0]] if known.size else np.nan,
            }
        )
    notes = list(log.notes)
    if gaps := int((np.diff(flight.times) > LONGEST_STEP).sum()):
        notes.append(
            f"gaps of more than a minute, or steps of the clock, which end a circle: {gaps}"
        )
    deciders = {find_rule(live.name).title: stated}
    figure = flight_figure(flight, modes, deciders, f"{name}: circles", "hindsight")
    return (
        pd.DataFrame(
            rows,
            index=range(1, len(rows) + 1),
        ),
        notes,
        figure,
    )


@dataclass
class Circles:
    """Find the circles of a glider's flight log: side, turns, wind, climb, and when a live decider
    stated them. Writes circles.csv and track.png.
    """

    log: tyro.conf.Positional[Path]
    """Flight log in the IGC format."""
    out: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="")] = None
    """Folder for the files; by default <name>_circles beside the log."""

    def run(self) -> None:
        """Find the circles, print the table and write the files."""
        name = self.log.name
        rows, notes, figure = find_circles(name, parse_igc(name, self.log.read_bytes()))
        print(rows.to_string(index=False))
        for note in notes:
            print(f"{name}: {note}")
        folder = self.out or self.log.with_name(f"{self.log.stem}_circles")
        folder.mkdir(parents=True, exist_ok=True)
        rows.to_csv(folder / "circles.csv", index_label="circle")
        figure.savefig(folder / "track.png")
        print(f"Files in {folder}")


if __name__ == "__main__":
    sys.exit(run_command(Circles, "python -m studies.gliders.circles"))
