"""Command line of the study: `python -m studies.gliders`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from joblib import delayed

from agents import run_command
from hybrid_env import ArgumentError
from studies.gliders.logs import EXPECTED
from studies.gliders.report import picture, report
from studies.gliders.study import (
    AFTER_SEAL,
    DECIDERS,
    compare_rule,
    find_rule,
    quick_halves,
    read_halves,
    simulated,
)
from studies.results import in_parallel, save_results
from studies.seal import unbroken_seal

SEAL = Path(__file__).with_name("sealed.json")
"""What was fixed before the sealed logs were opened: code, weights and settings."""


@dataclass(kw_only=True)
class Gliders:
    """Compare deciders on flights of paragliders, at equal false changes an hour.

    Prints values with 95 % intervals, flights drawn with replacement, and writes gliders.json and
    gliders.png.
    """

    source: Path | None = None
    """The archive igc-xc-score-1.8.0.tgz or a folder with its logs."""
    deciders: Annotated[tuple[str, ...], tyro.conf.Positional] = (*DECIDERS, "agent")
    """Rules, 'agent', or the folder of an agent; the first is the reference."""
    sealed: bool = False
    """Open the sealed logs too. Refused if code, weights or settings are not those of the seal."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Three deciders on short simulated flights instead of the logs."""
    out: Path = Path("results/gliders")
    """Folder for gliders.json and gliders.png."""

    def run(self) -> None:
        """Compare, print the tables and write the files."""
        names = ("imm-climb", "xcsoar-default", "agent") if self.quick else self.deciders
        for name in names:
            # An unknown one is refused before any work.
            find_rule(name)
        settings: dict[str, Any] = {}
        if self.sealed:
            settings = unbroken_seal(SEAL)["settings"]
            if unknown := set(names) - set(settings["5"]) - set(AFTER_SEAL):
                raise ArgumentError(f"deciders: the seal has no settings of {', '.join(unknown)}")
        if self.quick:
            flights = copies = quick_halves()
        elif self.source is None:
            raise ArgumentError(f"source: expected {EXPECTED}")
        else:
            flights, copies = read_halves(self.source, self.sealed), simulated()
        calls = [delayed(compare_rule)(name, flights, copies, settings) for name in names]
        results = dict(zip(names, in_parallel(calls, self.jobs, "deciders"), strict=True))
        save_results(
            self.out / "gliders", *report(flights, copies, results), picture(flights, results)
        )


if __name__ == "__main__":
    sys.exit(run_command(Gliders, "python -m studies.gliders"))
