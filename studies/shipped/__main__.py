"""Command line of the study: `python -m studies.shipped`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from agents import evaluate, run_command, train
from baselines import Estimate
from studies.results import in_brackets, markdown_table, save_results

FOLDER = Path(__file__).parent
# Environment of each recipe.
RECIPES = {
    "anchor": "HybridTrackPublished-v0",
    "anchor-all": "HybridTrackPublished-v0",
    "stopping": "HybridTrackPublished-v0",
    "rhythm": "HybridTrackQuickest-v0",
}
# Settings of a short training.
SHORT = ("n_envs=8", "batch_size=8", "ticks=100")


@dataclass(kw_only=True)
class Shipped:
    """Train agents as those of the package were trained, and compare them with the shipped ones."""

    recipes: Annotated[tuple[str, ...], tyro.conf.Positional] = ("anchor", "stopping", "rhythm")
    """'anchor' (two minutes), 'anchor-all' (for all environments), 'stopping' (20 minutes),
    'rhythm' (half an hour).
    """
    quick: bool = False
    """A short training of rhythm without a run folder, and two episodes."""
    out: Path = Path("results/shipped")
    """Folder for shipped.md, shipped.json and the run folders; an interrupted training goes on."""

    def run(self) -> None:
        """Train, print the table and write the files."""
        recipes = ("rhythm",) if self.quick else self.recipes
        rows = [self._row(recipe) for recipe in recipes]
        heads = ["recipe", "environment", "reward", "reward of shipped"]
        cells = [[*row[:2], *(in_brackets(each["reward"], 3) for each in row[2:])] for row in rows]
        save_results(self.out / "shipped", markdown_table(heads, cells), rows)

    def _row(self, recipe: str) -> tuple[str, str, dict[str, Estimate], dict[str, Estimate]]:
        env = RECIPES[recipe]
        short: dict[str, Any] = {"steps": 5_000, "changes": SHORT} if self.quick else {}
        agent = train(
            str(FOLDER / f"{recipe}.yml"),
            env,
            out=None if self.quick else self.out / recipe,
            resume=True,
            **short,
        )
        episodes = 2 if self.quick else 1000
        own, theirs = (evaluate(each, env, episodes=episodes) for each in (agent, "shipped"))
        return recipe, env, own, theirs


if __name__ == "__main__":
    sys.exit(run_command(Shipped, "python -m studies.shipped"))
