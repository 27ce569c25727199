"""Command line of the study: `python -m studies.gliders`."""

import json
import sys
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from agents import run_command
from hybrid_env import ArgumentError
from studies.gliders.logs import EXPECTED
from studies.gliders.rules import RULES
from studies.gliders.study import (
    AGENT,
    SIMULATED,
    SIMULATED_SEED,
    SIMULATED_TIME,
    as_json,
    candidate,
    compare_on_gliders,
    picture,
    quick_halves,
    read_halves,
    simulated,
    tables,
    unbroken_seal,
)


@dataclass(kw_only=True)
class Gliders:
    """Compare deciders on flights of paragliders, at equal false changes an hour.

    Prints figures with 95 % intervals, flights drawn with replacement, and writes gliders.json and
    gliders.png.
    """

    source: Path | None = None
    """The archive igc-xc-score-1.8.0.tgz or a folder with its logs."""
    deciders: tuple[str, ...] = (*RULES, AGENT)
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
        names = ("imm-climb", "xcsoar-default", AGENT) if self.quick else self.deciders
        for name in names:
            # An unknown one is refused before any work.
            candidate(name)
        seal = unbroken_seal(names) if self.sealed else None
        with Console().status("flights and labels") as status:
            if self.quick:
                flights, labels = copies = quick_halves()
            elif self.source is None:
                raise ArgumentError(f"source: expected {EXPECTED}")
            else:
                flights, labels = read_halves(self.source, self.sealed)
                copies = simulated(SIMULATED, SIMULATED_TIME, SIMULATED_SEED)
            status.update("deciders")
            result = compare_on_gliders(flights, labels, names, copies, self.jobs, seal)
        for title, table in tables(result).items():
            print(f"{title}\n{table.to_string(index=False)}\n")
        self.out.mkdir(parents=True, exist_ok=True)
        content = as_json(result)
        text = json.dumps(content, indent=2)
        (self.out / "gliders.json").write_text(text + "\n", encoding="utf-8")
        picture(result).savefig(self.out / "gliders.png")
        print(f"Files in {self.out}")


if __name__ == "__main__":
    sys.exit(run_command(Gliders, "python -m studies.gliders"))
