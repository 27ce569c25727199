"""The command `hybridtrack train-sequence`: the sequence agent into a run folder."""

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from agents.sequence_training import SequenceSettings
from agents.world_arguments import WorldArguments
from hybrid_env.checks import check_integer, check_positive, reject

STEPS = 6_000_000


@dataclass(kw_only=True)
class TrainSequence(WorldArguments):
    """Train the sequence agent, a recurrent network that learns the likelihood, into a run folder."""

    out: Path | None = None
    """Run folder, new or empty; default runs/<environment>-sequence-seed<seed>."""
    steps: int = STEPS
    """Environment steps, summed over tracks; the default takes three minutes."""
    seed: int = 0
    """Of weights, tracks and thresholds; the same seed gives the same weights."""
    noise: tuple[float, ...] = ()
    """Train on a world of each of these measurement variances [m^2] at once, instead of one."""
    sequence: tyro.conf.OmitArgPrefixes[SequenceSettings] = field(default_factory=SequenceSettings)
    """Hyper-parameters."""

    def run(self) -> None:
        """Train with a live display and say where the run is."""
        check_integer("seed", self.seed, minimum=0)
        check_integer("steps", self.steps)
        for value in self.noise:
            check_positive("noise", value)
        if self.noise and self.measurement_variance is not None:
            raise reject("noise", self.noise, "nothing where --measurement-variance is given")
        name = self.env_id.rpartition(":")[2]
        folder = self.out or Path("runs") / f"{name}-sequence-seed{self.seed}"
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise reject("out", str(folder), "a new or empty folder")
        from rich.console import Console

        from agents.evaluation import make_vector_env
        from agents.progress import progress_display
        from agents.sequence_training import train_sequence
        from agents.training import TrainingProgress

        options = self.world_options()
        worlds = [options | {"measurement_variance": value} for value in self.noise] or [options]
        for world in worlds:
            make_vector_env(self.env_id, 1, **world)  # refuses a bad world before anything is made
        console = Console()
        with progress_display(console) as display:
            task = display.add_task("Training", total=self.steps, note="")

            def show(now: TrainingProgress) -> None:
                display.update(task, completed=min(now.steps, now.total), note=now.note)

            train_sequence(self.env_id, worlds, self.steps, self.seed, self.sequence, folder, show)
        console.print(f"Run {folder}: {self.steps:,} steps", highlight=False)
        console.print(f"Next: hybridtrack evaluate {folder}", highlight=False)
