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

from agents import run_command
from baselines import parse_igc
from hybrid_env import ArgumentError
from studies.flights.figure import flight_figure
from studies.flights.labels import MODE_NAMES, spans
from studies.flights.turns import STRAIGHT
from studies.gliders.circling import air_motion, circles
from studies.gliders.logs import glider_flight
from studies.gliders.study import Setting, glider_statements


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
        """Find the circles, print a row for each time of circling to one side, and write the files.

        Raises:
            ArgumentError: the log has no flight.
        """
        name = self.log.name
        log = parse_igc(name, self.log.read_bytes())
        flight = glider_flight(name, "", log)
        if not flight.pieces:
            raise ArgumentError(f"{name}: expected 20 positions without a gap of a minute")
        (motion,) = air_motion([flight])
        modes, _ = circles(flight, motion.rates)
        # With about five false changes an hour on the open logs.
        live = Setting("imm-climb", 0, (0.95, 0.9))
        stated = glider_statements([flight], [live])[0][:, 0]
        rows = []
        # A gap ends a circle.
        for part, mode in spans(modes, flight.pieces):
            if mode == STRAIGHT:
                continue
            times = flight.times[part] - flight.times[part.start]
            wind = motion.wind[part].mean(0)
            turned = (motion.rates[part][:-1] * np.diff(times)).sum()
            gain = np.subtract(*log.altitudes[[part.stop - 1, part.start]])
            known = times[stated[part] == mode]
            # Seconds of a day.
            start = (log.times[0] + flight.times[part.start]) % 86400.0
            rows.append(
                {
                    "begin_utc": str(pd.to_timedelta(start, "s").floor("s"))[-8:],
                    "seconds": times[-1],
                    "side": MODE_NAMES[mode],
                    "turns": round(abs(turned) / (2.0 * np.pi), 2),
                    "wind": round(np.hypot(*wind), 2),
                    "wind_from": round(np.degrees(np.arctan2(*-wind)) % 360.0),
                    "climb": round(gain / max(times[-1], 1.0), 2),
                    "gain": round(gain),
                    "stated_after": known[0] if known.size else np.nan,
                }
            )
        table = pd.DataFrame(rows, index=range(1, len(rows) + 1))
        print(table.to_string(index=False), *log.notes, sep="\n")
        folder = self.out or self.log.with_name(f"{self.log.stem}_circles")
        folder.mkdir(parents=True, exist_ok=True)
        table.to_csv(folder / "circles.csv", index_label="circle")
        figure = flight_figure(flight, modes, {live.name: stated}, f"{name}: circles", "hindsight")
        figure.savefig(folder / "track.png")
        print(f"Files in {folder}")


if __name__ == "__main__":
    sys.exit(run_command(Circles, "python -m studies.gliders.circles"))
