"""The command `hybridtrack compare`: train agents and compare deciders on the same episodes."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from matplotlib.figure import Figure
from rich.console import Console

from agents.commands.play import Episodes
from agents.evaluation.tasks import task_of
from agents.figures.tracks import track_figure
from agents.interface.help_texts import shown_default
from agents.interface.output_files import output_folder, write_files, write_json
from agents.interface.parallel import ParallelArguments
from agents.interface.progress import print_lines, progress_display
from agents.interface.world_arguments import TrustArguments, WorldArguments
from baselines.rules import seeds
from hybrid_env.checks import (
    Count,
    NotNegative,
    Probability,
    checked,
    declared_fields,
    reject,
)

if TYPE_CHECKING:
    from agents.commands.comparison import Comparison
    from agents.commands.continuation import Plan


@dataclass(kw_only=True)
class Compare(WorldArguments, TrustArguments, ParallelArguments):
    """Compare learned agents with classical decision rules on the same episodes.

    The defaults train PPO for half a minute and take about two minutes on two cores. With --env
    HybridTrackQuickest-v0, rules and agents that state the mode at every tick are compared, in
    about three minutes. The same command continues an interrupted comparison.
    """

    deciders: Annotated[
        tuple[str, ...] | None, shown_default("the usual rules of the environment")
    ] = None
    """Classical rules, or rules of your own ('mine.py:MyRule'); the first is the reference.
    Announced switches: {announced}. Unknown switches: {unknown}.
    """
    agents: Annotated[
        tuple[str, ...] | None,
        shown_default(
            "ppo shipped, with the published bank also shipped-threshold; shipped for unknown"
            " switches"
        ),
    ] = None
    """Learned agents: recipes to train during the run ('ppo', 'anchor' ...), 'shipped',
    'shipped-threshold', 'shipped-margin' or 'robust' (weights in the package), run folders, or
    policies of other libraries ('model.zip', 'policy.onnx').
    """
    accuracy: Annotated[Probability | None, shown_default("the threshold with the best reward")] = (
        None
    )
    """Select the fastest threshold that reaches this accuracy."""
    curves: bool = True
    """Score every decider at every threshold; without curves, all but the reference at their
    selected one only, in half the time.
    """
    episodes: Annotated[
        Count | None, shown_default("1500; 500 for unknown switches", "--tracks")
    ] = None
    """Number of episodes, of one track each, that every decider is scored on."""
    selection_episodes: Annotated[Count | None, shown_default("1000; 300 for unknown switches")] = (
        None
    )
    """Number of separate episodes for the selection of thresholds."""
    seed: NotNegative = 0
    """Seed of the first evaluation episode; training and threshold selection use other seeds."""
    steps: Annotated[Count | None, shown_default("those of the recipe")] = None
    """Environment steps of each training."""
    training_seeds: Count = 1
    """Number of agents to train per recipe, each with its own seed."""
    out: Path = Path("results")
    """Folder for compare.png (operating curves), episode.png (the episode on which the best agent
    and the reference differ most), compare.json, and agents (a run folder for each trained agent).
    """

    def run(self) -> None:
        """Train, score, print the tables and write the figures and compare.json."""
        plan, workers = self.plan(), self.workers()
        from agents.commands.comparison import compare
        from agents.commands.continuation import TRAINED
        from agents.commands.tables import (
            chosen_table,
            further_tables,
            levels_table,
            spread_lines,
            unreached_lines,
        )

        folder, task, console = output_folder("out", self.out), plan.task, Console(emoji=False)

        def write(now: "Comparison") -> None:
            write_json(folder / "compare.json", now.as_json() | {"complete": False})

        with progress_display(console) as progress:
            try:
                result = compare(plan, workers, progress, folder, write)
            except KeyboardInterrupt:
                raise KeyboardInterrupt(
                    f"the same command continues with what is in {folder}"
                ) from None
            remarks = task.remarks(plan.episodes, plan.seed)
        console.print(chosen_table(result))
        if plan.curves:
            console.print(levels_table(result))
        print_lines(console, *spread_lines(result), *unreached_lines(result))
        for table in further_tables(result, remarks):
            console.print(table)
        data = result.as_json() | {"complete": True} | remarks
        files = {
            "compare.png": result.picture(),
            "episode.png": self._episode(result),
            "compare.json": data,
        }
        print_lines(console, write_files(folder, files))
        if (folder / TRAINED).is_dir():
            print_lines(console, f"Trained agents in {folder / TRAINED}")

    def plan(self) -> "Plan":
        """Return the checked plan."""
        hints = declared_fields(Compare)
        # Not the deciders, which may be functions.
        for name in (
            "episodes",
            "selection_episodes",
            "training_seeds",
            "steps",
            "seed",
            "accuracy",
        ):
            checked(name, getattr(self, name), hints[name])
        from agents.commands.continuation import Plan

        task = task_of(self.env_id, self.world_options())
        values: dict[str, Any] = {
            field.name: getattr(self, field.name) for field in fields(Plan) if field.name != "task"
        }
        usual: dict[str, Any] = {
            name: getattr(task, name) for name in ("agents", "episodes", "selection_episodes")
        }
        usual["deciders"] = task.compared
        values |= {name: value for name, value in usual.items() if values[name] is None}
        plan = Plan(task, **values)
        if self.accuracy is not None and "accuracy" not in task.columns:
            raise reject("accuracy", self.accuracy, f"no value in {task.title}")
        if self.seed + plan.episodes > seeds.SELECTION:
            raise reject(
                "seed",
                self.seed,
                f"at most {seeds.SELECTION} minus the number of episodes",
            )
        if not plan.deciders or len(set(plan.deciders)) != len(plan.deciders):
            raise reject("deciders", plan.deciders, "one or more different names")
        if len(set(plan.agents)) != len(plan.agents):
            raise reject("agents", plan.agents, "different names")
        # Before any file is written.
        task.check_episodes("episodes", plan.episodes)
        task.check_episodes("selection-episodes", plan.selection_episodes)
        # Looks every name up.
        assert plan.titles
        return plan

    def _episode(self, result: "Comparison") -> Figure:
        """Draw the episode on which the best decider and the reference differ most."""
        plan, task = result.plan, result.plan.task
        best, episode = result.largest_difference()
        seed, records = plan.seed + episode, []
        for entry in dict.fromkeys((result.entries[0], best)):
            decider = entry.found(task).at(entry.threshold)
            episodes = Episodes(task, entry.name, decider, decider.options)
            # Matplotlib would read it as a formula.
            name = entry.name.replace("$", r"\$")
            records.append(episodes.record(name, seed))
        title = f"{task.title}, seed {seed}"
        if len(records) > 1:
            title += f": largest difference in reward among {task.size(plan.episodes)}"
        lines = [title, *(f"{record.name}: {record.summary}" for record in records)]
        return track_figure(records, task.options.radii, "\n".join(lines))
