"""Command line of the study: `python -m studies.tuning`."""

import sys
from dataclasses import dataclass
from pathlib import Path

from agents import load_recipe, run_command
from hybrid_env import ArgumentError
from studies.tuning import search


@dataclass(kw_only=True)
class Tune:
    """Search for hyper-parameters of a recipe with Optuna, and write the best ones as a recipe.

    The first trial is the recipe as it is. A training that is worse than half of the earlier ones
    ends early. The same command continues an interrupted search, and with a larger --trials one
    that has ended. The reward of the best trial is a little too high, because the trial was
    selected by it: evaluate the trained agent.
    """

    recipe: str = "ppo"
    """Recipe to begin with, or a YAML file."""
    env: str = "hybrid_env:HybridTrack-v0"
    """Registered id of the environment."""
    search: tuple[str, ...] = ()
    """What to search: n_epochs=1..10 (integers), gae_lambda=0.8..1.0, batch_size=512|1024|2048. A
    positive range of a factor of ten or more is searched on a logarithmic scale. By default that of
    the algorithm.
    """
    set: tuple[str, ...] = ()
    """Hyper-parameters to override in all trials, such as n_envs=128."""
    trials: int = 30
    """Number of trials of the search, those of earlier calls included."""
    steps: int | None = None
    """Environment steps of each training; by default those of the recipe."""
    seed: int = 0
    """Seed of the trainings and of the proposals."""
    jobs: int = -1
    """Number of processes; -1 for one on each core. The results do not depend on it."""
    quick: bool = False
    """Three trials of short trainings of PPO."""
    out: Path = Path("results/tuning")
    """Folder of the search: trials.log and best.yml."""

    def run(self) -> None:
        """Search, print the best trials and write best.yml."""
        changes, trials, steps = self.set, self.trials, self.steps
        if self.quick:
            changes, trials, steps = ("n_envs=8", "n_steps=32", "batch_size=64"), 3, 512
        algorithm = load_recipe(self.recipe, self.env, changes).algo
        ranges = search.parse_ranges(self.search, algorithm)
        wanted = search.Search(self.env, self.recipe, changes, ranges, self.seed, steps)
        self.out.mkdir(parents=True, exist_ok=True)
        study = search.open_study(wanted, self.out)
        search.run_trials(wanted, study, trials, self.jobs)
        table = study.trials_dataframe(attrs=("number", "value", "params", "state"))
        table = table[table.pop("state") == "COMPLETE"]
        if table.empty:
            raise ArgumentError(f"trials={trials}: none was trained to its end")
        best = table.sort_values("value", ascending=False, kind="stable").head(5)
        print(f"Best of {len(search.ended(study))} trials")
        print(best.to_string(index=False, float_format="{:.3g}".format))
        path = search.write_best(wanted, study, self.out)
        print(f"Next: hybridtrack train --recipe {path}")


if __name__ == "__main__":
    sys.exit(run_command(Tune, "python -m studies.tuning"))
