"""The command `hybridtrack evaluate`: any decider, in numbers."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from agents.world_arguments import WorldArguments
from hybrid_env.checks import check_integer, reject


@dataclass(kw_only=True)
class Evaluate(WorldArguments):
    """Measure one decider: accuracy, decision time, reward and tracking error, and what it confuses."""

    decider: tyro.conf.Positional[str] = "ate"
    """'ate', 'fixed', 'msprt', 'msprt-type', 'gap', 'ml', 'bayes', 'shipped' or a run folder, also with a
    threshold: 'ate:1e-6', 'fixed:30', 'runs/ppo:-2'."""
    episodes: int = 1000
    """Episodes to measure on."""
    seed: int = 0
    """Of the first episode; the next have the next seeds."""
    out: Path | None = None
    """JSON file for the figures."""

    def run(self) -> None:
        """Evaluate and print the tables."""
        check_integer("episodes", self.episodes)
        check_integer("seed", self.seed, minimum=0)
        if self.out is not None and not self.out.parent.is_dir():
            raise reject("out", str(self.out), "a file in a folder that exists")
        from rich.console import Console
        from rich.table import Table

        from agents.deciders import load_decider
        from agents.evaluation import evaluate, make_vector_env
        from agents.progress import progress_display
        from agents.writing import write_json
        from hybrid_env.rendering import mode_name

        env_id, options = self.world_of(self.decider)
        world = make_vector_env(env_id, 1, **options).options
        decider = load_decider(self.decider, world)
        console = Console()
        with progress_display(console) as progress:
            task = progress.add_task("Evaluating", total=1.0, note=self.decider)
            decisions = evaluate(
                decider, env_id, self.episodes, self.seed,
                lambda share: progress.update(task, completed=share), **options,
            )  # fmt: skip
        summary = decisions.summary()

        table = Table(
            title=f"{self.decider} on {env_id.rpartition(':')[2]}: {summary['segments']:,} segments"
        )
        for head in ("figure", "mean", "95 % interval"):
            table.add_column(head, justify="left" if head == "figure" else "right")
        names = {
            "accuracy": "right decisions", "type_accuracy": "right type (S, L or R)",
            "ticks": "decision time, ticks", "reward": "reward a segment", "forced": "undecided at the end",
            "rmse": "position RMSE, m",
        }  # fmt: skip
        for key, name in names.items():
            low, high = summary[key]["interval"]
            table.add_row(name, f"{summary[key]['mean']:.4f}", f"{low:.4f} to {high:.4f}")
        console.print(table)

        modes = world.hypotheses
        counts = np.zeros((modes, modes), np.int64)
        np.add.at(counts, (decisions.true_mode, decisions.decided_mode), 1)
        if modes <= 5:
            confusion = Table(title="True mode in rows, decided mode in columns")
            confusion.add_column("")
            for mode in range(modes):
                confusion.add_column(mode_name(mode, world.radii), justify="right")
            for mode in range(modes):
                confusion.add_row(mode_name(mode, world.radii), *map(str, counts[mode]))
            console.print(confusion)
        if self.out is not None:
            write_json(self.out, {"decider": self.decider, "confusion": counts.tolist()} | summary)
            console.print(f"Data {self.out}", highlight=False)
