"""Command line of the study: `python -m studies.league`."""

import json
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.progress import track

from agents import find_family, markdown_table, run_command
from hybrid_env import ArgumentError
from studies.league import families
from studies.league.protocol import (
    BANK,
    QUICK_WORLDS,
    QUICKEST,
    THREE,
    Protocol,
    collect,
    make_entry,
    play_world,
    read_entry,
    world_task,
)
from studies.league.table import league_figure, league_tables, shipped_entries, world_table


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
    recipes: tuple[str, ...] = ()
    """Recipes whose agents are trained, and trained further if that was interrupted: 'reward',
    'tandem', 'kalman', 'transformer', 'distilled', 'jump-markov', 'q-deep' or 'q-linear' of this
    study, one of the package, or a YAML file.
    """
    training_seeds: int = 5
    """Number of agents trained per recipe."""
    steps: int | None = None
    """Environment steps of each training; by default those of the recipe."""
    table: tuple[Path, ...] = ()
    """Files of the league to show, besides those of the study."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    trust: bool = False
    """Unpickle model.zip, which runs the code in it."""
    quick: bool = False
    """Three worlds, few episodes, and two seeds of short trainings; nothing is shown beside."""
    out: Path = Path("results/league")
    """Folder for a JSON file of each decider, league.md and league.png; of recipes also the run
    folders and training.png.
    """

    def run(self) -> None:
        """Play the deciders, print the tables and write the files."""
        protocol = Protocol(jobs=self.jobs)
        seeds, steps, tracks = self.training_seeds, self.steps, families.PROBED_TRACKS
        deciders, recipes = self.deciders, self.recipes
        if self.quick:
            episodes = {THREE: 8, BANK: 8, QUICKEST: 3}
            protocol = Protocol(
                QUICK_WORLDS,
                episodes,
                self.jobs,
            )
            seeds, steps, tracks = 2, 2000, 16
            deciders, recipes = deciders or ("msprt", "threshold"), recipes or ("tandem",)
        # What cannot be found or imported is refused before any work.
        for recipe in recipes:
            families.home_of(recipe)
        for name in deciders:
            check_name(name)
        shown = [*map(read_entry, self.table)] if self.quick else shown_entries(self.table)
        self.out.mkdir(parents=True, exist_ok=True)
        calls = [
            partial(
                play_world,
                name,
                world,
                protocol.episodes[world_task(world).env_id],
            )
            for name in deciders
            for world in protocol.worlds
        ]
        results = list(
            track(
                protocol.parallel(calls),
                "Playing",
                len(calls),
            )
        )
        played: list[dict[str, Any]] = []
        for k, name in enumerate(deciders):
            part = results[k * len(protocol.worlds) :][: len(protocol.worlds)]
            entry = collect(
                name,
                dict(
                    zip(
                        protocol.worlds,
                        part,
                        strict=True,
                    )
                ),
            )
            # A decider with the title of another is called by its name.
            if entry["title"] in {other["title"] for other in (*shown, *played)}:
                entry = make_entry(
                    name,
                    name,
                    entry["kind"],
                    entry["worlds"],
                )
            played.append(entry)
        runs = {}
        for recipe in track(recipes, "Training"):
            entry, runs[recipe] = families.play_family(
                recipe, seeds, steps, protocol, self.out, tracks
            )
            played.append(entry)
        self._report(
            played,
            shown,
            runs,
        )

    def _report(
        self,
        played: list[dict[str, Any]],
        shown: list[dict[str, Any]],
        runs: dict[str, list[Path]],
    ) -> None:
        """Print the tables and write the files."""
        entries = [*({entry["title"]: entry for entry in (*shown, *played)}).values()]
        for entry in played:
            file = "".join(sign if sign.isalnum() else "-" for sign in entry["title"]) + ".json"
            (self.out / file).write_text(json.dumps(entry, indent=2), encoding="utf-8")
            print(f"{entry['title']} ({entry['kind']})")
            print(world_table(entry, entries).to_string(index=False), end="\n\n")
            refused: dict[str, list[str]] = {}
            for world, content in entry["worlds"].items():
                if "refused" in content:
                    refused.setdefault(content["refused"], []).append(world)
            for reason, worlds in refused.items():
                print(f"It cannot decide in {'; '.join(worlds)}: {reason}")
        tables = [*league_tables(entries), *families.families_tables(entries).values()]
        for table in tables:
            print(table.to_string(index=False), end="\n\n")
        text = "\n".join(markdown_table([*table], table.to_numpy()) for table in tables)
        (self.out / "league.md").write_text(text, encoding="utf-8")
        league_figure(entries).savefig(self.out / "league.png")
        if runs:
            families.training_figure(runs).savefig(self.out / "training.png")
        print(f"Files in {self.out}")


def shown_entries(files: tuple[Path, ...]) -> list[dict[str, Any]]:
    """Return the entries of the study and of other files; refuse two with one title."""
    entries = {entry["title"]: entry for entry in shipped_entries()}
    for path in files:
        entry = read_entry(path)
        if entries.setdefault(entry["title"], entry) != entry:
            raise ArgumentError(f"{path}: its title {entry['title']!r} is that of another decider")
    return [*entries.values()]


def check_name(name: str) -> None:
    """Refuse a decider that no environment has."""
    refusals = []
    for env_id in (THREE, QUICKEST):
        try:
            find_family(name, world_task(families.HOMES[env_id]).options)
        except ArgumentError as error:
            refusals.append(error)
    if len(refusals) == 2:
        raise refusals[0]


if __name__ == "__main__":
    sys.exit(run_command(League, "python -m studies.league"))
