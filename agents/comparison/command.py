"""The command `hybridtrack compare`: train agents and compare deciders on the same episodes."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from agents.evaluation import seeds
from agents.interface.world_arguments import WorldArguments
from hybrid_env.checks import check_integer, reject

if TYPE_CHECKING:
    from agents.comparison.study import Comparison


@dataclass(kw_only=True)
class Compare(WorldArguments):
    """Compare learned agents with classical decision rules on the same episodes.

    The defaults train PPO for about half a minute and take about six minutes in total on two cores.
    """

    deciders: tuple[str, ...] = ("ate", "fixed", "msprt", "msprt-kept", "calibrated")
    """Classical rules; the first is the reference: 'ate', 'fixed', 'msprt', 'msprt-type', 'msprt-kept' (keeps
    the covariance at switches), 'msprt-aware' (anchor-aware bank), 'calibrated' (anchor error fitted during
    the run), 'calibrated-robust' (with filters that reject outliers), 'gap', 'ml' (maximum likelihood at the
    end), 'bayes' (Bayes risk, fitted during the run)."""
    agents: tuple[str, ...] = ("ppo", "shipped")
    """Learned agents: recipes to train during the run ('ppo', 'anchor' ...), 'shipped' (weights in the
    package), or run folders."""
    accuracy: float | None = None
    """Select the fastest threshold that reaches this accuracy; by default the one with the best reward."""
    curves: bool = True
    """False evaluates all deciders but the reference at their selected threshold only, in half the time."""
    episodes: int = 1500
    """Number of episodes that every decider is evaluated on."""
    selection_episodes: int = seeds.SELECTION_EPISODES
    """Number of separate episodes for the selection of thresholds."""
    seed: int = 0
    """Seed of the first evaluation episode; training and threshold selection use other seeds."""
    steps: int | None = None
    """Environment steps of each training; by default as in the recipe."""
    training_seeds: int = 1
    """Number of agents to train per recipe, each with its own seed."""
    out: Path = Path("results")
    """Folder for compare.png (operating curves), episode.png (the episode on which the best agent and the
    reference differ most) and compare.json."""

    def run(self) -> None:
        """Train, evaluate, print the tables and write the figures and compare.json.

        Raises:
            ArgumentError: an argument is out of range, or the output folder cannot be written.
        """
        for name in ("episodes", "selection_episodes", "training_seeds"):
            check_integer(name.replace("_", "-"), getattr(self, name))
        if self.steps is not None:
            check_integer("steps", self.steps)
        check_integer("seed", self.seed, minimum=0)
        if self.accuracy is not None and not 0.0 < self.accuracy < 1.0:
            raise reject("accuracy", self.accuracy, "a number between 0 and 1")
        if self.seed + self.episodes > seeds.SELECTION:
            raise reject("seed", self.seed, f"at most {seeds.SELECTION} minus the number of episodes")
        if not self.deciders or len(set(self.deciders)) != len(self.deciders):
            raise reject("deciders", self.deciders, "one or more different names")
        if len(set(self.agents)) != len(self.agents):
            raise reject("agents", self.agents, "different names")
        from rich.console import Console

        from agents.comparison.figure import draw_operating_curves
        from agents.comparison.report import (
            calibration_table,
            comparison_table,
            error_table,
            summary_lines,
            unreached_accuracy_lines,
        )
        from agents.comparison.study import Plan, compare
        from agents.interface.output_files import output_folder, write_json
        from agents.interface.progress import progress_display

        plan = Plan(
            self.env_id,
            self.world_options(),
            self.deciders,
            self.agents,
            self.episodes,
            self.seed,
            self.steps,
            self.training_seeds,
            self.accuracy,
            self.curves,
            self.selection_episodes,
        )
        plan.families()  # reject invalid deciders before any file is written
        folder = output_folder("out", self.out)
        console = Console(emoji=False)
        with progress_display(console) as progress:
            result = compare(plan, progress)
        console.print(comparison_table(result))
        for line in summary_lines(result):
            console.print(line, markup=False, highlight=False, soft_wrap=True)
        for line in unreached_accuracy_lines(result):
            console.print(line, markup=False, highlight=False)
        console.print(error_table(result))
        console.print(calibration_table(result))
        draw_operating_curves(result, folder / "compare.png")
        self._draw_episode(result, folder)
        write_json(folder / "compare.json", result.as_json())
        pictures = "compare.png, episode.png" if result.learned else "compare.png"
        console.print(f"Files in {folder}: {pictures}, compare.json", markup=False, highlight=False)

    def _draw_episode(self, result: "Comparison", folder: Path) -> None:
        from agents.comparison.episode_figure import draw_episode, record_episode

        found = result.largest_difference()
        if found is None:
            return
        best, episode = found
        plan, seed = result.plan, self.seed + episode
        records = []
        for entry in (result.entries[0], best):
            family = entry.curve.family
            decider = family.make(family.thresholds[entry.chosen])
            options = plan.options | family.options
            name = entry.name.replace("$", r"\$")  # Matplotlib would read it as a formula
            records.append(record_episode(name, decider, plan.env_id, seed, **options))
        title = (
            f"{plan.env_id.rpartition(':')[2]}, seed {seed}: "
            f"largest difference in reward among {plan.episodes:,} episodes"
        )
        draw_episode(records[0], records[1], result.world, title, folder / "episode.png")
