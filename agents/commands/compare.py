"""The command `hybridtrack compare`: train agents and compare deciders on the same episodes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from rich.console import Console

from agents.comparison.plan import Plan
from agents.interface.output_files import output_folder, write_files
from agents.interface.progress import print_lines, progress_display
from agents.interface.world_arguments import WorldArguments


@dataclass(kw_only=True)
class Compare(Plan):
    """Compare learned agents with classical decision rules on the same episodes.

    The defaults train PPO for half a minute and take about two minutes on two cores. With --env
    HybridTrackQuickest-v0, rules and agents that state the mode at every tick are compared, in
    about three minutes. The same command continues an interrupted comparison.
    """

    GROUPS: ClassVar[Mapping[str, Sequence[str]]] = {
        "comparison": ("curves", "steps", "training_seeds", "trust"),
        "episode": ("episodes", "selection_episodes", "seed"),
        "output": ("out", "jobs", "engine"),
        **WorldArguments.GROUPS,
    }

    out: Path = Path("results")
    """Folder for compare.png (operating curves), compare.json, and agents (a run folder for each
    trained agent).
    """

    def run(self) -> None:
        """Train, score, print the tables and write the figures and compare.json."""
        console = Console(emoji=False)
        with progress_display(console) as progress:
            plan = self.completed()
            folder = output_folder(self.out)
            try:
                result = plan.compare(folder, progress)
            except KeyboardInterrupt:
                raise KeyboardInterrupt(
                    f"the same command continues with what is in {folder}"
                ) from None
        for table in result.tables():
            console.print(table)
        files = {"compare.png": result.picture(), "compare.json": result.as_json()}
        print_lines(console, *result.lines(), write_files(folder, files))
        if any(entry.folder for entry in result.entries):
            print_lines(console, f"Trained agents in {folder / 'agents'}")
