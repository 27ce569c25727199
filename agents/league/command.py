"""The command `hybridtrack league`: play deciders by a fixed protocol, and show the table."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from agents.evaluation.cells import filled_table, markdown_table
from agents.evaluation.registry import distinct_titles, find_family, is_brought, shipped_names
from agents.interface.help_texts import shown_default
from agents.interface.output_files import output_folder, write_files
from agents.interface.parallel import ParallelArguments
from agents.interface.progress import print_lines, progress_display
from agents.interface.world_arguments import TrustArguments
from baselines.rules.decider import ANNOUNCED, UNKNOWN, rules
from hybrid_env.checks import check_integer, reject


@dataclass(kw_only=True)
class League(TrustArguments, ParallelArguments):
    """Play deciders in twelve worlds by a fixed protocol, beside those that come with the package.

    Worlds, seeds and the selection of thresholds are fixed, so that files of different people
    compare. A rule of your own takes one to ten minutes. With --table, files are shown and nothing
    is played.
    """

    deciders: Annotated[tyro.conf.Positional[tuple[str, ...]], shown_default("none is played")] = ()
    """Deciders without thresholds: 'mine.py:MyRule', 'model.zip', a run folder, 'shipped',
    'robust' or a rule. The name of another recipe, or a YAML file, is a
    family: its agents are trained, and trained further if that was interrupted.
    """
    training_seeds: int = 5
    """Number of agents trained per recipe."""
    steps: Annotated[int | None, shown_default("those of the recipe")] = None
    """Environment steps of each training."""
    table: Annotated[tuple[Path, ...], shown_default("those of the package")] = ()
    """Files of the league to show, besides those of the package."""
    out: Path = Path("results")
    """Folder for a JSON file of each decider, league.md and league.png; of recipes also the run
    folders and training.png.
    """

    def run(self) -> None:
        """Play the deciders, print the tables and write the files."""
        workers = self.workers()
        check_integer("training-seeds", self.training_seeds)
        if self.steps is not None:
            check_integer("steps", self.steps)
        for name in self.deciders:
            if len(name.rpartition(":")[0]) > 1 and not name.rpartition(":")[2].isidentifier():
                raise reject(
                    "deciders",
                    name,
                    "a name without a threshold; the protocol selects it",
                )
        from agents.league import families
        from agents.league.protocol import WORLDS, play, read_entry, world_task
        from agents.league.table import (
            league_figure,
            league_markdown,
            league_table,
            shipped_entries,
            world_table,
        )
        from agents.training.recipe import recipe_names

        entries = {entry["title"]: entry for entry in shipped_entries()}
        shipped = set(entries)
        for path in self.table:
            entry = read_entry(path)
            if entries.setdefault(entry["title"], entry) != entry:
                owner = "the package" if entry["title"] in shipped else "another file"
                raise reject(
                    "table",
                    str(path),
                    f"a title that {owner} has not; this one is {entry['title']!r}",
                )
        agents = set(shipped_names(ANNOUNCED, UNKNOWN))
        known = {*agents, *rules(ANNOUNCED), *rules(UNKNOWN)}
        # A name of weights of the package means those.
        trained = set(recipe_names()) - agents
        recipes = [name for name in self.deciders if name in trained or name.endswith(".yml")]
        # One that cannot be found or imported is refused before any work.
        for name in self.deciders:
            if name in recipes:
                families.home_of(name)
            elif name not in known and not is_brought(name):
                find_family(name, world_task("R = 0.1").options)
        titles = distinct_titles(self.deciders, [families.title_of(name) for name in self.deciders])
        for position, (name, title) in enumerate(zip(self.deciders, titles, strict=True)):
            # Such as a run folder "runs/ppo".
            if title in shipped and name not in known | trained:
                titles[position] = name
            if (name in recipes and titles[position] != title) or titles.count(title) > 1:
                raise reject(
                    "deciders",
                    name,
                    f"a title of its own; {title!r} is that of another decider",
                )
        folder = output_folder("out", self.out)
        console = Console(emoji=False)
        played = []
        runs = {}
        with progress_display(console) as progress:
            parts = {
                name: 2 * self.training_seeds if name in recipes else len(WORLDS)
                for name in self.deciders
            }
            bar = progress.add_task("Playing", total=sum(parts.values()), note="")
            for name, title in zip(self.deciders, titles, strict=True):

                def done(part: str | int, name: str = name) -> None:
                    progress.update(
                        bar,
                        advance=1,
                        note=f"{name} seed {part}" if isinstance(part, int) else part,
                    )

                if name in recipes:
                    seeds, steps = self.training_seeds, self.steps
                    entry, runs[name] = families.play_family(
                        name,
                        seeds,
                        steps,
                        workers,
                        folder,
                        done,
                    )
                else:
                    entry = play(name, workers, done, title=title)
                file = "".join(one if one.isalnum() else "-" for one in entry["title"]) + ".json"
                write_files(folder, {file: entry})
                played.append(entry)
                print_lines(progress.console, folder / file)
            progress.update(bar, note="")
        every = [*(entries | {entry["title"]: entry for entry in played}).values()]
        for entry in played:
            refused: dict[str, list[str]] = {}
            for world, one in entry["worlds"].items():
                if "refused" in one:
                    refused.setdefault(one["refused"], []).append(world)
            for reason, worlds in refused.items():
                print_lines(
                    console,
                    f"{entry['title']} cannot decide in: {'; '.join(worlds)}. The reason: {reason}",
                )
            console.print(world_table(entry, every))
        console.print(league_table(every))
        tables = [league_markdown(every)]
        for env_id, (heads, rows) in families.families_tables(every).items():
            title = f"Trained families in {env_id.rpartition(':')[2]}"
            short, *lines = (
                [*row[:2], *row[-3:]]
                for row in ([head.replace(" ", "\n") for head in heads], *rows)
            )
            console.print(filled_table(title, short, lines, families.CAPTION))
            tables.append(markdown_table(heads, rows))
        files = {"league.md": "\n".join(tables), "league.png": league_figure(every)}
        if runs:
            files["training.png"] = families.training_figure(runs)
        print_lines(console, write_files(folder, files))
