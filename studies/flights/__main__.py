"""Command line of the study: `python -m studies.flights`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from agents import run_command
from studies.flights.study import (
    COMPARED,
    compare_on_flights,
    picture,
    quick_flights,
    read_flights,
    report,
)
from studies.results import save_results


@dataclass(kw_only=True)
class Flights:
    """Compare deciders on recorded flights of the package 'traffic'.

    Prints values with 95 % intervals, flights drawn with replacement, and writes flights.json and
    a picture of each flight.
    """

    flights: Annotated[tuple[str, ...], tyro.conf.Positional] = ()
    """Flights file:icao24:k; by default those of the tiers."""
    source: Path | None = None
    """Folder of the package 'traffic'; by default where it is installed."""
    tier: tuple[Literal["A", "B", "C", "D", "stress"], ...] = ("A", "B", "C", "D", "stress")
    """Tiers of quality, and flights with special manoeuvres, which no total contains."""
    deciders: tuple[str, ...] = ()
    """The first is the reference: imm, cusum, beam, hindsight, agent with an optional ':threshold',
    or the folder of an agent.
    """
    quick: bool = False
    """Short simulated flights instead of the recorded ones."""
    out: Path = Path("results/flights")
    """Folder for flights.json and the pictures."""

    def run(self) -> None:
        """Compare, print the tables and write the files."""
        names = tuple(dict.fromkeys(self.deciders)) or COMPARED
        flights = (
            quick_flights() if self.quick else read_flights(self.source, self.flights, self.tier)
        )
        result = compare_on_flights(flights, names)
        tables, content = report(result)
        save_results(self.out / "flights", tables, content)
        for k, flight in enumerate(flights):
            picture(result, k).savefig(self.out / f"{flight.identity.replace(':', '-')}.png")


if __name__ == "__main__":
    sys.exit(run_command(Flights, "python -m studies.flights"))
