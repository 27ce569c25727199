"""Command line of the study: `python -m studies.league`."""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.progress import track

from agents import run_command
from studies.league.protocol import EPISODES, play, read_entry
from studies.league.table import league_figure, league_tables, shipped_entries, world_table
from studies.results import markdown_table


@dataclass(kw_only=True)
class League:
    """Play deciders in twelve worlds by a fixed protocol, beside those that come with the study.

    Worlds, seeds and the selection of thresholds are fixed, so that files of different people
    compare. A rule of your own takes one to ten minutes.
    """

    deciders: Annotated[tuple[str, ...], tyro.conf.Positional] = ()
    """Deciders without thresholds: 'mine.py:MyRule', 'model.zip', a run folder, 'shipped' or a
    rule. Without any, files are shown and nothing is played.
    """
    table: tuple[Path, ...] = ()
    """Files of the league to show, besides those of the study."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    trust: bool = False
    """Unpickle model.zip, which runs the code in it."""
    quick: bool = False
    """Three worlds and few episodes; nothing is shown beside."""
    out: Path = Path("results/league")
    """Folder for a JSON file of each decider, league.md and league.png."""

    def run(self) -> None:
        """Play the deciders, print the tables and write the files."""
        episodes, deciders = EPISODES, self.deciders
        if self.quick:
            episodes = {"R = 0.1": 8, "R = 1": 8, "unknown, R = 0.1": 3}
            deciders = deciders or ("msprt", "threshold")
        files = map(read_entry, self.table)
        shown = [*([] if self.quick else shipped_entries()), *files]
        self.out.mkdir(parents=True, exist_ok=True)
        played = [play(name, episodes, self.jobs) for name in track(deciders, "Playing")]
        entries = [*({entry["title"]: entry for entry in (*shown, *played)}).values()]
        for entry in played:
            file = "".join(sign if sign.isalnum() else "-" for sign in entry["title"]) + ".json"
            (self.out / file).write_text(json.dumps(entry, indent=2), encoding="utf-8")
            print(f"{entry['title']} ({entry['kind']})")
            print(world_table(entry, entries).to_string(index=False), end="\n\n")
            for world, content in entry["worlds"].items():
                if "refused" in content:
                    print(f"It cannot decide in {world}: {content['refused']}")
        tables = league_tables(entries)
        for table in tables:
            print(table.to_string(index=False), end="\n\n")
        text = "\n".join(markdown_table([*table], table.to_numpy()) for table in tables)
        (self.out / "league.md").write_text(text, encoding="utf-8")
        league_figure(entries).savefig(self.out / "league.png")
        print(f"Files in {self.out}")


if __name__ == "__main__":
    sys.exit(run_command(League, "python -m studies.league"))
