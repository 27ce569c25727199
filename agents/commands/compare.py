"""The command `hybridtrack compare`: train agents and compare deciders on the same episodes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from rich.console import Console

from agents.comparison.plan import Plan
from agents.evaluation.registry import find_decider
from agents.interface.output_files import output_folder, write_files
from agents.interface.progress import print_lines, progress_display
from agents.interface.world_arguments import WorldArguments

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from agents.comparison.comparison import Comparison


@dataclass(kw_only=True)
class Compare(Plan):
    """Compare learned agents with classical decision rules on the same episodes.

    The defaults train PPO for half a minute and take about two minutes on two cores. With --env
    HybridTrackQuickest-v0, rules and agents that state the mode at every tick are compared, in
    about three minutes. The same command continues an interrupted comparison.
    """

    GROUPS: ClassVar[Mapping[str, Sequence[str]]] = {
        "comparison": ("accuracy", "curves", "steps", "training_seeds", "trust"),
        "episode": ("episodes", "selection_episodes", "seed"),
        "output": ("out", "jobs", "engine"),
        **WorldArguments.GROUPS,
    }

    out: Path = Path("results")
    """Folder for compare.png (operating curves), episode.png (the episode on which the best agent
    and the reference differ most), compare.json, and agents (a run folder for each trained agent).
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
        files = {
            "compare.png": result.picture(),
            "episode.png": self._episode(result),
            "compare.json": result.as_json(),
        }
        print_lines(console, *result.lines(), write_files(folder, files))
        if any(entry.folder for entry in result.entries):
            print_lines(console, f"Trained agents in {folder / 'agents'}")

    def _episode(self, result: "Comparison") -> "Figure":
        """Draw the episode on which the best decider and the reference differ most."""
        # Matplotlib; a wrong name is refused sooner.
        from agents.evaluation.episodes import Episodes
        from agents.figures.tracks import track_figure

        task = result.plan.task
        best, episode = result.largest_difference()
        seed, records = self.seed + episode, []
        for entry in dict.fromkeys((result.entries[0], best)):
            name = entry.decider if entry.folder is None else str(entry.folder)
            decider = find_decider(name, task.options).at(entry.threshold)
            episodes = Episodes(task, entry.name, decider)
            # Matplotlib would read it as a formula.
            records.append(episodes.record(entry.name.replace("$", r"\$"), seed))
        title = f"{task.title}, seed {seed}"
        if len(records) > 1:
            title += f": largest difference in reward among {task.size(result.plan.episodes)}"
        lines = [title, *(f"{record.name}: {record.summary}" for record in records)]
        return track_figure(records, task.options.all_modes, "\n".join(lines))
