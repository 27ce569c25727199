"""The command `hybridtrack train`: train an agent with a recipe."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from agents.interface.help_texts import shown_default
from agents.interface.world_arguments import WorldArguments
from hybrid_env.checks import Count, NotNegative, reject


@dataclass(kw_only=True)
class Train(WorldArguments):
    """Train an agent with a recipe; write weights, card, metrics and learning curve to a run
    folder.
    """

    recipe: str = "ppo"
    """'ppo' (half a minute), 'recurrent-ppo', 'a2c', 'dqn', 'qrdqn', or a YAML file."""
    set: Annotated[tuple[str, ...], shown_default("those of the recipe")] = ()
    """Hyper-parameters to override, such as n_envs=128 policy_kwargs.net_arch=[32]."""
    out: Annotated[Path | None, shown_default("runs/<environment>-<recipe>-seed<seed>")] = None
    """Run folder, new or empty."""
    resume: Path | None = None
    """Resume the run in this folder, with its environment and recipe; takes only --steps."""
    steps: Annotated[Count | None, shown_default("those of the recipe or of the resumed run")] = (
        None
    )
    """Environment steps, summed over tracks."""
    seed: NotNegative = 0
    """Seed of weights, tracks and mini-batches; training is reproducible for a given seed."""

    def run(self) -> None:
        """Train with a progress display and print a summary."""
        from agents.learned.algorithm_names import find_algorithm
        from agents.training.recipe import load_recipe

        # A wrong name is refused before PyTorch is imported, which is slow.
        options = self.world_options()
        recipe = load_recipe(self.recipe, self.env_id, self.set, "modes" in options)
        from agents.training.runs import make_run, resume_run

        if self.resume is not None:
            folder = self.resume
            if self != Train(resume=self.resume, steps=self.steps):
                raise reject("resume", str(folder), "no flag other than --steps")
            run = resume_run(folder, self.steps)
        else:
            name = find_algorithm(recipe.algo).run_name(self.env_id, recipe.name)
            folder = self.out or Path("runs") / f"{name}-seed{self.seed}"
            run = make_run(self.env_id, options, recipe, self.seed, folder, self.steps)
        from rich.console import Console

        from agents.interface.progress import progress_display
        from agents.training.learning_curve import draw_learning_curve
        from agents.training.run_folder import read_metrics

        console = Console(emoji=False)
        with progress_display(console) as display:
            bar = display.add_task(f"Training {run.recipe.name}", total=run.steps, note="")

            def show(now: Any) -> None:
                display.update(bar, completed=min(now.steps, now.total), note=now.note)

            try:
                run.train(show)
            except KeyboardInterrupt:
                again = f"hybridtrack train --resume {folder} continues from its last checkpoint"
                raise KeyboardInterrupt(again) from None
            display.update(bar, completed=run.steps)
        for line in run.curve.summary(read_metrics(folder)):
            console.print(line, highlight=False, soft_wrap=True)
        draw_learning_curve(folder, folder / "learning.png", run.curve)
        steps = f"{run.num_timesteps:,} steps"
        console.print(f"Run {folder}: {steps}, learning.png", markup=False, highlight=False)
        console.print(f"Next: {run.next_command} {folder}", markup=False, highlight=False)
