"""The command `hybridtrack train`: an agent into a run folder, by a recipe."""

from dataclasses import dataclass
from pathlib import Path

from agents.interface.world_arguments import WorldArguments
from hybrid_env.checks import check_integer, check_positive, reject


@dataclass(kw_only=True)
class Train(WorldArguments):
    """Train an agent by a recipe into a run folder: weights, card, metrics, and its learning curve."""

    recipe: str = "ppo"
    """'ppo' (half a minute), 'sequence' (three minutes), 'sequence-all' (one network for many worlds),
    'stopping' (PPO on what the shipped network believes), 'recurrent-ppo', three that lack something
    ('ppo-zero-wait-bias', 'ppo-posteriors', 'ppo-innovations'), or a YAML file."""
    set: tuple[str, ...] = ()
    """Hyper-parameters other than the recipe's, such as n_envs=128 policy_kwargs.net_arch=[32]."""
    out: Path | None = None
    """Run folder, new or empty; default runs/<environment>-<recipe>-seed<seed>."""
    resume: Path | None = None
    """Go on with this run folder, its own world and recipe; only --steps and --save-every beside."""
    steps: int | None = None
    """Environment steps, summed over tracks; default the recipe's, or the resumed run's."""
    seed: int = 0
    """Of weights, tracks and mini-batches; the same seed gives the same weights."""
    save_every: float = 10.0
    """Seconds between checkpoints; a killed run loses no more than that and one rollout."""

    def run(self) -> None:
        """Train with a live display and say where the run is."""
        check_integer("seed", self.seed, minimum=0)
        check_positive("save-every", self.save_every)
        if self.steps is not None:
            check_integer("steps", self.steps)
        from agents.training.recipe import load_recipe
        from agents.training.run import TrainingProgress
        from agents.training.runs import make_run, resume_run

        if self.resume is not None:
            folder = self.resume
            if self != Train(resume=self.resume, steps=self.steps, save_every=self.save_every):
                raise reject("resume", str(folder), "no other flag than --steps and --save-every beside it")
            run = resume_run(folder, self.steps)
        else:
            recipe = load_recipe(self.recipe, self.env_id, self.set)
            name = self.env_id.rpartition(":")[2]
            folder = self.out or Path("runs") / f"{name}-{recipe.name}-seed{self.seed}"
            if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
                raise reject("out", str(folder), "a new or empty folder, or --resume to go on with a run")
            run = make_run(self.env_id, self.world_options(), recipe, self.seed, folder, self.steps)
        from rich.console import Console

        from agents.interface.progress import progress_display
        from agents.training.learning_curve import summary
        from agents.training.learning_figure import draw_learning
        from agents.training.run_folder import read_metrics

        console = Console()
        with progress_display(console) as display:
            task = display.add_task("Training", total=run.steps, note="")

            def show(now: TrainingProgress) -> None:
                display.update(task, completed=min(now.steps, now.total), note=now.note)

            run.train(show, self.save_every)
        for line in summary(read_metrics(folder)):
            console.print(line, highlight=False, soft_wrap=True)
        draw_learning(folder, folder / "learning.png")
        console.print(f"Run {folder}: {run.done:,} steps, learning.png", highlight=False)
        console.print(f"Next: hybridtrack evaluate {folder}", highlight=False)
