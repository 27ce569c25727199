"""The command `hybridtrack train`: PPO into a run folder."""

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from agents.ppo_settings import STEPS, PPOSettings
from agents.world_arguments import WorldArguments
from hybrid_env.checks import check_integer, check_positive, reject


@dataclass(kw_only=True)
class Train(WorldArguments):
    """Train PPO into a run folder: weights, card, metrics and TensorBoard events."""

    out: Path | None = None
    """Run folder, new or empty; default runs/<environment>-ppo-seed<seed>."""
    resume: Path | None = None
    """Go on with this run folder, with its own world and settings; only --steps may be given with it."""
    steps: int | None = None
    """Environment steps, summed over tracks; default 1,500,000 (half a minute), or the resumed run's."""
    seed: int = 0
    """Of weights, tracks and mini-batches; the same seed gives the same weights."""
    save_every: float = 10.0
    """Seconds between checkpoints; a killed run loses no more than that and one rollout."""
    ppo: tyro.conf.OmitArgPrefixes[PPOSettings] = field(default_factory=PPOSettings)
    """Hyper-parameters."""

    def run(self) -> None:
        """Train with a live display and say where the run is."""
        check_integer("seed", self.seed, minimum=0)
        check_positive("save-every", self.save_every)
        if self.steps is not None:
            check_integer("steps", self.steps)
        name = self.env_id.rpartition(":")[2]
        folder = self.resume or self.out or Path("runs") / f"{name}-ppo-seed{self.seed}"
        if self.resume is not None:
            if self != Train(resume=self.resume, steps=self.steps, save_every=self.save_every):
                raise reject("resume", str(folder), "no other flag than --steps and --save-every beside it")
        elif folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise reject("out", str(folder), "a new or empty folder, or --resume to go on with a run")
        from rich.console import Console

        from agents.progress import progress_display
        from agents.training import TrainingProgress, TrainingRun

        if self.resume is not None:
            training = TrainingRun.resume(folder, self.steps)
        else:
            steps = STEPS if self.steps is None else self.steps
            training = TrainingRun(self.env_id, self.world_options(), self.ppo, self.seed, folder, steps)
        console = Console()
        with progress_display(console) as display:
            task = display.add_task("Training PPO", total=training.steps, note="")

            def show(now: TrainingProgress) -> None:
                display.update(task, completed=min(now.steps, now.total), note=now.note)

            training.train(show, self.save_every)
        console.print(f"Run {folder}: {training.model.num_timesteps:,} steps", highlight=False)
        console.print(f"Next: hybridtrack evaluate {folder}", highlight=False)
