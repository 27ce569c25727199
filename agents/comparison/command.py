"""The command `hybridtrack compare`: train agents, sweep every decider, compare all on the same episodes."""

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
    """Train PPO for about half a minute and compare it with the classical rules on the same episodes."""

    deciders: tuple[str, ...] = ("ate", "fixed", "msprt")
    """Classical rules, the first as the reference: 'ate', 'fixed', 'msprt', 'msprt-type', 'gap', 'ml' (the
    likeliest at the end), 'bayes' (fitted now)."""
    agents: tuple[str, ...] = ("ppo", "shipped")
    """Learned deciders: recipes to train by now ('ppo', 'sequence' ...), 'shipped' (weights that come with
    the package), or run folders."""
    accuracy: float | None = None
    """Choose thresholds that reach this accuracy soonest, not those of the best reward."""
    curves: bool = True
    """False measures all but the reference at their chosen thresholds only: half the time."""
    episodes: int = 1500
    """Episodes that every decider is measured on."""
    selection_episodes: int = seeds.SELECTION_EPISODES
    """Other episodes, on which thresholds are chosen."""
    seed: int = 0
    """First seed of those episodes; training and the choice of thresholds use others."""
    steps: int | None = None
    """Environment steps of each training; default the recipe's."""
    training_seeds: int = 1
    """Agents to train by each recipe, each with its own seed."""
    out: Path = Path("results")
    """Folder for compare.png, duel.png (an episode on which the best agent and the reference differ) and
    compare.json."""

    def run(self) -> None:
        """Train, sweep, print the table, write figure and data."""
        for name in ("episodes", "selection_episodes", "training_seeds"):
            check_integer(name.replace("_", "-"), getattr(self, name))
        if self.steps is not None:
            check_integer("steps", self.steps)
        check_integer("seed", self.seed, minimum=0)
        if self.accuracy is not None and not 0.0 < self.accuracy < 1.0:
            raise reject("accuracy", self.accuracy, "a number between 0 and 1")
        if self.seed + self.episodes > seeds.SELECTION:
            raise reject("seed", self.seed, f"at most {seeds.SELECTION} less the episodes")
        if not self.deciders or len(set(self.deciders)) != len(self.deciders):
            raise reject("deciders", self.deciders, "one or more different names")
        if len(set(self.agents)) != len(self.agents):
            raise reject("agents", self.agents, "different names")
        from rich.console import Console

        from agents.comparison.figure import draw_operating_curves
        from agents.comparison.report import (
            bank_table,
            comparison_table,
            error_table,
            headlines,
            missed_accuracy,
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
        plan.families()  # refuses what cannot be compared, before anything is made
        folder = output_folder("out", self.out)
        console = Console()
        with progress_display(console) as progress:
            result = compare(plan, progress)
        console.print(comparison_table(result))
        for line in headlines(result):
            console.print(line, highlight=False, soft_wrap=True)
        for line in missed_accuracy(result):
            console.print(line, highlight=False)
        console.print(error_table(result))
        console.print(bank_table(result))
        draw_operating_curves(result, folder / "compare.png")
        self._draw_duel(result, folder)
        write_json(folder / "compare.json", result.as_json())
        pictures = "compare.png, duel.png" if result.learned else "compare.png"
        console.print(f"Files in {folder}: {pictures}, compare.json", highlight=False)

    def _draw_duel(self, result: "Comparison", folder: Path) -> None:
        from agents.comparison.episode_figure import draw_duel, fly

        widest = result.widest()
        if widest is None:
            return
        best, episode = widest
        plan, seed = result.plan, self.seed + episode
        flights = []
        for entry in (result.entries[0], best):
            family = entry.curve.family
            decider = family.make(family.thresholds[entry.chosen])
            flights.append(fly(entry.name, decider, plan.env_id, seed, **plan.options))
        most = f"where they differ most of {plan.episodes:,} episodes"
        title = f"{plan.env_id.rpartition(':')[2]}, seed {seed}: {most}"
        draw_duel(flights[0], flights[1], result.world, title, folder / "duel.png")
