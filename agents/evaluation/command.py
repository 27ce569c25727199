"""The command `hybridtrack evaluate`: metrics of deciders, nominal or under distribution shift."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro

from agents.interface.help_texts import shown_default
from agents.interface.parallel_arguments import ParallelArguments
from agents.interface.world_arguments import WorldArguments
from baselines.rules import seeds
from hybrid_env.checks import check_integer, check_number, reject
from hybrid_env.noises import parse_noise
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import environment_options

if TYPE_CHECKING:
    from baselines.rules.decider import Decider

MOST_DRAWN = 1000  # random worlds
LARGEST_FACTOR = 10.0


@dataclass(kw_only=True)
class Evaluate(WorldArguments, ParallelArguments):
    """Evaluate deciders: accuracy, decision time, reward, tracking error, confusion matrix.

    With --env HybridTrackQuickest-v0: share of right ticks, delay, missed switches, wrong changes, reward.
    """

    deciders: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        shown_default("ate; threshold in HybridTrackQuickest-v0"),
    ] = ()
    """'ate', 'fixed', 'msprt', 'msprt-type', 'msprt-kept', 'msprt-aware', 'calibrated',
    'calibrated-robust', 'gap', 'ml', 'bayes', 'shipped' or a run folder, with optional thresholds:
    'ate:1e-6', 'fixed:30', 'runs/ppo:-2'. 'ate-robust' and 'msprt-robust' are those rules on a bank with
    a robust likelihood.
    In HybridTrackQuickest-v0: 'threshold', 'cusum', 'shiryaev-roberts', 'glr', 'detector-2020',
    'beam', 'beam-geometric', 'shipped' or a run folder: 'threshold:0.7'."""
    episodes: int = 1000
    """Number of evaluation episodes."""
    seed: int = 0
    """Seed of the first episode; later episodes use consecutive seeds."""
    shifted: bool = False
    """Evaluate under distribution shift (noise, radii, segment lengths, speed, outliers), at the thresholds
    with the best reward on as many other episodes, at most 1,000, of each environment and of the nominal
    one. The names then take no thresholds."""
    drawn: int = 0
    """Evaluate in this many random worlds, and in the nominal one, as with --shifted."""
    noises: tuple[str, ...] = ()
    """Evaluate under these laws of noise, and in the nominal environment, as with --shifted."""
    beyond: float = 2.0
    """Factor by which the ranges of random worlds exceed those of the training of the shipped agent."""
    out: Annotated[Path | None, shown_default("none is written")] = None
    """JSON file for the metrics."""

    def run(self) -> None:
        """Evaluate the deciders and print the tables."""
        check_integer("episodes", self.episodes)
        self.workers()  # checks --jobs and --engine also where one evaluation needs neither
        check_integer("seed", self.seed, minimum=0)
        if self.out is not None and not self.out.parent.is_dir():
            raise reject("out", str(self.out), "a file in a folder that exists")
        if len(set(self.deciders)) != len(self.deciders):
            raise reject("deciders", self.deciders, "different names")
        from agents.interface.output_files import write_json

        check_integer("drawn", self.drawn, minimum=0, maximum=MOST_DRAWN)
        if not 1.0 <= check_number("beyond", self.beyond) <= LARGEST_FACTOR:
            raise reject("beyond", self.beyond, f"a number from 1 to {LARGEST_FACTOR:g}")
        if self.beyond != type(self).beyond and not self.drawn:
            raise reject("beyond", self.beyond, "no value without --drawn")
        metrics: Any
        if self._states_modes():
            metrics = self._evaluate_statements(self.deciders or ("threshold",))
        else:
            metrics = self._evaluate_decisions(self.deciders or ("ate",))
        if self.out is not None:
            write_json(self.out, metrics)
            print(f"Data {self.out}")

    def _states_modes(self) -> bool:
        """Whether the environment has unknown switch moments."""
        env_id, _ = self.world_of(self.deciders[0]) if self.deciders else (self.env_id, {})
        return issubclass(environment_options(env_id), QuickestOptions)

    def _evaluate_statements(self, deciders: tuple[str, ...]) -> list[dict[str, Any]]:
        from agents.evaluation.evaluate_statements import evaluate_statements

        if self.shifted or self.drawn:
            name, value = ("shifted", True) if self.shifted else ("drawn", self.drawn)
            raise reject(name, value, "no value with unknown switch moments")
        if self.noises:
            raise reject("noises", self.noises, "none with unknown switch moments; --noise chooses one")
        env_id, options = self.world_of(deciders[0])
        return evaluate_statements(deciders, env_id, options, self.episodes, self.seed)

    def _evaluate_decisions(self, deciders: tuple[str, ...]) -> Any:
        shifted = self.shifted or self.drawn > 0 or bool(self.noises)
        if shifted and self.seed + self.episodes > seeds.SELECTION:
            limit = (
                f"at most {seeds.SELECTION} minus the number of episodes, with --shifted, --drawn or --noises"
            )
            raise reject("seed", self.seed, limit)
        if shifted:
            return self._evaluate_shifts(deciders)
        loaded = [self._load(name) for name in deciders]  # checks all names before evaluating
        metrics = [self._evaluate(*one) for one in loaded]
        return metrics[0] if len(metrics) == 1 else metrics

    def _evaluate_shifts(self, deciders: tuple[str, ...]) -> dict[str, Any]:
        from rich.console import Console

        from agents.evaluation.deciders import check_family, decider_family
        from agents.evaluation.drawn_worlds import draw_worlds
        from agents.evaluation.shifted_worlds import (
            NOMINAL,
            differences,
            evaluate_shifts,
            shift_table,
            shifted_worlds,
        )
        from agents.interface.progress import progress_display
        from hybrid_env.registration import make_vector_env

        workers = self.workers()
        env_id, options = self.world_of(deciders[0])
        world = make_vector_env(env_id, 1, **options).options
        for name in deciders:
            if ":" in name and not Path(name).is_dir():
                raise reject(
                    "deciders", name, "a name without a threshold, with --shifted, --drawn or --noises"
                )
        worlds = shifted_worlds(world) if self.shifted else {NOMINAL: {}}
        worlds |= {str(parse_noise(noise, "noises")): {"noise": noise} for noise in self.noises}
        worlds |= draw_worlds(self.drawn, seeds.DRAWN_WORLDS, self.beyond)
        for name in deciders:
            check_family(decider_family(name, world), name, world)
        console = Console(emoji=False)
        with progress_display(console) as progress:
            total = len(deciders) * len(worlds)
            task = progress.add_task("Evaluating", total=total, note="")
            results = evaluate_shifts(
                deciders, env_id, worlds, options, self.episodes, self.seed, workers,
                lambda note: progress.update(task, advance=1, note=note),
            )  # fmt: skip
            progress.update(task, note="")
        segments = self.episodes * world.segments
        name = env_id.rpartition(":")[2]
        console.print(shift_table(results, f"{name} under distribution shift: {segments:,} segments each"))
        found: dict[str, Any] = {"results": [result.as_json() for result in results]}
        if len(deciders) > 1:
            found["differences"] = [asdict(one) for one in differences(results)]
        return found | {"worlds": worlds}

    def _load(self, name: str) -> tuple[str, str, dict[str, Any], "Decider"]:
        from agents.evaluation.deciders import load_decider, world_changes
        from hybrid_env.registration import make_vector_env

        env_id, options = self.world_of(name)
        world = make_vector_env(env_id, 1, **options).options
        options = options | world_changes(name, world)
        return name, env_id, options, load_decider(name, make_vector_env(env_id, 1, **options).options)

    def _evaluate(
        self, name: str, env_id: str, options: dict[str, Any], decider: "Decider"
    ) -> dict[str, Any]:
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        from agents.evaluation.evaluate import evaluate
        from agents.interface.progress import progress_display
        from hybrid_env.registration import make_vector_env
        from hybrid_env.rendering.modes import mode_name

        world = make_vector_env(env_id, 1, **options).options
        console = Console(emoji=False)
        with progress_display(console) as progress:
            task = progress.add_task("Evaluating", total=1.0, note=name)
            decisions = evaluate(
                decider, env_id, self.episodes, self.seed,
                lambda fraction: progress.update(task, completed=fraction), **options,
            )  # fmt: skip
        summary = decisions.summary()

        title = f"{name} on {env_id.rpartition(':')[2]}: {summary['segments']:,} segments"
        table = Table(title=escape(title))
        for header in ("metric", "mean", "95 % confidence interval"):
            table.add_column(header, justify="left" if header == "metric" else "right")
        titles = {
            "accuracy": "accuracy", "type_accuracy": "type accuracy (S, L or R)",
            "ticks": "decision time, ticks", "reward": "reward per segment",
            "forced": "undecided at segment end",
            "rmse": "position RMSE, m",
        }  # fmt: skip
        for key, title in titles.items():
            low, high = summary[key]["interval"]
            table.add_row(title, f"{summary[key]['mean']:.4f}", f"{low:.4f} to {high:.4f}")
        console.print(table)

        modes = world.hypotheses
        counts = np.zeros((modes, modes), np.int64)
        np.add.at(counts, (decisions.true_mode, decisions.decided_mode), 1)
        if modes <= 5:
            confusion = Table(title="Confusion matrix: true mode in rows, decided mode in columns")
            confusion.add_column("")
            for mode in range(modes):
                confusion.add_column(mode_name(mode, world.radii), justify="right")
            for mode in range(modes):
                confusion.add_row(mode_name(mode, world.radii), *map(str, counts[mode]))
            console.print(confusion)
        return {"decider": name, "confusion": counts.tolist()} | summary
