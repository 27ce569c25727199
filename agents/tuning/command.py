"""The command `hybridtrack tune`: search for hyper-parameters of a recipe."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.console import Console

from agents.evaluation.cells import filled_table
from agents.interface.help_texts import shown_default
from agents.interface.output_files import output_folder
from agents.interface.parallel import ParallelArguments
from agents.interface.progress import print_lines, progress_display
from agents.interface.world_arguments import WorldArguments
from agents.training.run_folder import lock
from hybrid_env.checks import check_integer, reject

# Trials in the table.
SHOWN = 5


@dataclass(kw_only=True)
class Tune(WorldArguments, ParallelArguments):
    """Search for hyper-parameters of a recipe with Optuna, and write the best ones as a recipe.

    The first trial is the recipe as it is. A training that is worse than half of the earlier ones
    ends early. The same command continues an interrupted search, and with a larger --trials one
    that has ended. The reward of the best trial is a little too high, because the trial was
    selected by it: evaluate the trained agent.
    """

    recipe: str = "ppo"
    """Recipe to begin with, or a YAML file."""
    search: Annotated[tuple[str, ...], shown_default("depends on the algorithm")] = ()
    """What to search: n_epochs=1..10 (integers), gae_lambda=0.8..1.0, batch_size=512|1024|2048. A
    positive range of a factor of ten or more is searched on a logarithmic scale.
    """
    set: tuple[str, ...] = ()
    """Hyper-parameters to override in all trials, such as n_envs=128."""
    trials: int = 30
    """Number of trials of the search, those of earlier calls included."""
    steps: Annotated[int | None, shown_default("those of the recipe")] = None
    """Environment steps of each training."""
    seed: int = 0
    """Seed of the trainings and of the proposals."""
    out: Annotated[Path | None, shown_default("runs/tune-<environment>-<recipe>")] = None
    """Folder of the search: trials.log and best.yml."""

    def run(self) -> None:
        """Search with a progress display, print the best trials and write best.yml."""
        check_integer("trials", self.trials)
        check_integer("seed", self.seed, minimum=0, maximum=2**31 - 1)
        if self.steps is not None:
            check_integer("steps", self.steps)
        workers = self.workers()
        from agents.training.recipe import load_recipe
        from agents.training.runs import make_run, run_name
        from agents.tuning import search

        recipe = load_recipe(self.recipe, self.env_id, self.set)
        ranges = search.parse_ranges(self.search, recipe)
        options = self.world_options()
        # Refuses what cannot be trained.
        make_run(self.env_id, options, recipe, self.seed, steps=self.steps)
        wanted = search.Search(
            self.env_id,
            options,
            self.recipe,
            self.set,
            ranges,
            self.seed,
            self.steps,
        )
        folder = output_folder(
            "out",
            self.out or Path("runs") / f"tune-{run_name(self.env_id, recipe)}",
        )
        console = Console(emoji=False)
        with lock(folder):
            study = search.open_study(wanted, folder)
            with progress_display(console) as progress:
                task = progress.add_task(
                    "Tuning",
                    total=self.trials,
                    completed=len(search.ended(study)),
                    note="",
                )

                def show(note: str) -> None:
                    best = search.best_rows(study, 1)
                    shown = f"{note}, best reward {best[0].value:+.3f}" if best else note
                    progress.update(task, advance=1, note=shown)

                try:
                    search.run_trials(wanted, study, self.trials, workers, show)
                except OSError as error:
                    # Optuna's errors do not name its file.
                    name = error.filename or str(folder / search.JOURNAL)
                    raise OSError(error.errno, error.strerror, name) from None
            rows = search.best_rows(study, SHOWN)
            if not rows:
                raise reject("trials", self.trials, "more trials: none was trained to its end")
            path = search.write_best(wanted, study, folder)
        lines = []
        for row in rows:
            values = [row.params[name] for name in ranges]
            shown = [f"{value:.3g}" if isinstance(value, float) else str(value) for value in values]
            lines.append((str(row.number), f"{row.value:.3f}", *shown))
        heads = ("trial", "reward", *ranges)
        console.print(filled_table(f"Best of {len(search.ended(study))} trials", heads, lines))
        print_lines(console, f"Best recipe: {path}", f"Next: hybridtrack train --recipe {path}")
