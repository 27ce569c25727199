"""The command `hybridtrack compare`: train agents and compare deciders on the same episodes."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from agents.evaluation import seeds
from agents.interface.help_texts import shown_default
from agents.interface.parallel_arguments import ParallelArguments
from agents.interface.world_arguments import WorldArguments
from hybrid_env.checks import check_integer, reject
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import environment_options

if TYPE_CHECKING:
    from agents.comparison.study import Comparison

DECIDERS = ("ate", "fixed", "msprt", "msprt-kept", "calibrated")
AGENTS = ("ppo", "shipped")
EPISODES = 1500
TRACKS = 500  # episodes with unknown switch moments, each of about eight segments
SELECTION_TRACKS = 300
DECISION_FLAGS = ("accuracy", "curves", "steps", "training_seeds")
"""Flags that do not apply to unknown switch moments."""
FLIGHT_FLAGS = ("deciders", "flights", "source", "tier", "form", "out")
"""Flags that apply to recorded flights."""


def _default(decisions: str, statements: str, *aliases: str) -> object:
    """Help text of a default that depends on the environment."""
    return shown_default(f"{decisions}; {statements} in HybridTrackQuickest-v0", *aliases)


@dataclass(kw_only=True)
class Compare(WorldArguments, ParallelArguments):
    """Compare learned agents with classical decision rules on the same episodes.

    The defaults train PPO for about half a minute and take about four minutes in total. With
    --env HybridTrackQuickest-v0, rules and agents that state the mode at every tick are compared, in about
    three minutes. An interrupted comparison goes on when it is started again.
    """

    deciders: Annotated[tuple[str, ...] | None, _default(" ".join(DECIDERS), "all")] = None
    """Classical rules; the first is the reference: 'ate', 'fixed', 'msprt', 'msprt-type', 'msprt-kept' (keeps
    the covariance at switches), 'msprt-aware' (anchor-aware bank), 'calibrated' (anchor error fitted during
    the run), 'calibrated-robust' (with filters that reject outliers), 'gap', 'ml' (maximum likelihood at the
    end), 'bayes' (Bayes risk, fitted during the run), 'ate-robust' and 'msprt-robust' (on a bank with a
    robust likelihood).
    In HybridTrackQuickest-v0: 'threshold' (on the probabilities of the bank), 'cusum', 'shiryaev-roberts',
    'glr', 'detector-2020' (of Golubkov 2020), 'beam' (semi-Markov posterior), 'beam-geometric' (which does
    not know the law of durations)."""
    agents: Annotated[tuple[str, ...] | None, _default(" ".join(AGENTS), "shipped")] = None
    """Learned agents: recipes to train during the run ('ppo', 'anchor' ...), 'shipped' (weights in the
    package), or run folders. In HybridTrackQuickest-v0 'shipped' or run folders."""
    accuracy: Annotated[float | None, shown_default("the threshold with the best reward")] = None
    """Select the fastest threshold that reaches this accuracy."""
    curves: bool = True
    """Evaluate every decider at every threshold; without curves, all but the reference at their selected one
    only, in half the time."""
    episodes: Annotated[int | None, _default(f"{EPISODES}", f"{TRACKS}", "--tracks")] = None
    """Number of episodes, of one track each, that every decider is evaluated on."""
    selection_episodes: Annotated[
        int | None, _default(f"{seeds.SELECTION_EPISODES}", f"{SELECTION_TRACKS}")
    ] = None
    """Number of separate episodes for the selection of thresholds."""
    seed: int = 0
    """Seed of the first evaluation episode; training and threshold selection use other seeds."""
    steps: Annotated[int | None, shown_default("those of the recipe")] = None
    """Environment steps of each training."""
    training_seeds: int = 1
    """Number of agents to train per recipe, each with its own seed."""
    flights: tuple[str, ...] | None = None
    """Compare on recorded flights of the package 'traffic': without a value on those of the tiers, else on
    these ids file:icao24:k. Deciders are then 'imm', 'imm:0.8', 'cusum', 'beam', 'agent', or a folder."""
    source: Path | None = None
    """With --flights: folder or wheel of the package 'traffic'; by default where it is installed."""
    tier: tuple[str, ...] = ("A", "B", "C", "D", "stress")
    """With --flights: tiers of quality, and flights with special manoeuvres, which no total contains."""
    form: Literal["native", "semi-real"] = "native"
    """With --flights: as reported, or the smoothed flight with white noise in the setting of
    HybridTrackQuickest-v0, whose deciders are then compared, 'shipped' among them."""
    out: Path = Path("results")
    """Folder for compare.png (operating curves), episode.png (the episode on which the best agent and the
    reference differ most), compare.json, and agents (a run folder for each trained agent)."""

    def run(self) -> None:
        """Train, evaluate, print the tables and write the figures and compare.json.

        Raises:
            ArgumentError: an argument is out of range, or the output folder cannot be written.
        """
        if self.flights is not None:
            self._compare_flights()
        elif self.source is not None:
            raise reject("source", str(self.source), "no value without --flights")
        elif self.tier != type(self).tier:
            raise reject("tier", self.tier, "no value without --flights")
        elif self.form != type(self).form:
            raise reject("form", self.form, "no value without --flights")
        elif issubclass(environment_options(self.env_id), QuickestOptions):
            self._compare_statements()
        else:
            self._compare_decisions()

    def _compare_flights(self) -> None:
        from agents.comparison.flights_command import run_flight_comparison
        from agents.comparison.flights_study import FlightPlan

        assert self.flights is not None
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name not in FLIGHT_FLAGS and value != field.default:
                raise reject(field.name.replace("_", "-"), value, "no value with --flights")
        plan = FlightPlan(self.source, self.flights, self.tier, self.form, self.deciders or ())
        run_flight_comparison(plan, self.out)

    def _check(self, deciders: tuple[str, ...], agents: tuple[str, ...], episodes: int) -> None:
        """Check what both kinds of environment have in common."""
        for name in ("episodes", "selection_episodes", "training_seeds"):
            value = getattr(self, name)
            if value is not None:
                check_integer(name.replace("_", "-"), value)
        if self.steps is not None:
            check_integer("steps", self.steps)
        check_integer("seed", self.seed, minimum=0)
        if self.accuracy is not None and not 0.0 < self.accuracy < 1.0:
            raise reject("accuracy", self.accuracy, "a number between 0 and 1")
        if self.seed + episodes > seeds.SELECTION:
            raise reject("seed", self.seed, f"at most {seeds.SELECTION} minus the number of episodes")
        if not deciders or len(set(deciders)) != len(deciders):
            raise reject("deciders", deciders, "one or more different names")
        if len(set(agents)) != len(agents):
            raise reject("agents", agents, "different names")

    def _compare_statements(self) -> None:
        from agents.comparison.statement_command import run_statement_comparison
        from agents.comparison.statement_study import StatementPlan
        from agents.evaluation.statement_deciders import RULES, shipped_agents

        deciders = tuple(RULES) if self.deciders is None else self.deciders
        agents = shipped_agents() if self.agents is None else self.agents
        episodes = TRACKS if self.episodes is None else self.episodes
        self._check(deciders, agents, episodes)
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in DECISION_FLAGS and value != field.default:
                name = field.name.replace("_", "-")
                raise reject(name, value, "no value with unknown switch moments")
        selection = SELECTION_TRACKS if self.selection_episodes is None else self.selection_episodes
        options = self.world_options()
        plan = StatementPlan(self.env_id, options, deciders, agents, episodes, self.seed, selection)
        run_statement_comparison(plan, self.workers(), self.out)

    def _compare_decisions(self) -> None:
        deciders = DECIDERS if self.deciders is None else self.deciders
        agents = AGENTS if self.agents is None else self.agents
        episodes = EPISODES if self.episodes is None else self.episodes
        self._check(deciders, agents, episodes)
        from rich.console import Console

        from agents.comparison.continuation import TRAINED
        from agents.comparison.figures import operating_curves
        from agents.comparison.plan import Plan
        from agents.comparison.report import (
            calibration_table,
            comparison_table,
            error_table,
            summary_lines,
            unreached_accuracy_lines,
        )
        from agents.comparison.study import compare, evaluate_ahead
        from agents.figures.canvas import save_figure
        from agents.interface.output_files import output_folder, write_json
        from agents.interface.progress import progress_display

        plan = Plan(
            self.env_id,
            self.world_options(),
            deciders,
            agents,
            episodes,
            self.seed,
            self.steps,
            self.training_seeds,
            self.accuracy,
            self.curves,
            seeds.SELECTION_EPISODES if self.selection_episodes is None else self.selection_episodes,
        )
        plan.families()  # reject invalid deciders before any file is written
        workers = self.workers()
        folder = output_folder("out", self.out)
        console = Console(emoji=False)
        with progress_display(console) as progress:
            try:
                if workers.parallel:
                    evaluate_ahead(plan, folder, workers, progress)
                result = compare(
                    plan, progress, folder, lambda now: write_json(folder / "compare.json", now.as_json())
                )
            except KeyboardInterrupt:
                raise KeyboardInterrupt(f"the same command goes on with what is in {folder}") from None
        console.print(comparison_table(result))
        for line in summary_lines(result):
            console.print(line, markup=False, highlight=False, soft_wrap=True)
        for line in unreached_accuracy_lines(result):
            console.print(line, markup=False, highlight=False)
        console.print(error_table(result))
        console.print(calibration_table(result))
        save_figure(operating_curves(result), folder / "compare.png")
        self._draw_episode(result, folder)
        write_json(folder / "compare.json", result.as_json())
        pictures = "compare.png, episode.png" if result.learned else "compare.png"
        console.print(f"Files in {folder}: {pictures}, compare.json", markup=False, highlight=False)
        if (folder / TRAINED).is_dir():
            console.print(f"Trained agents in {folder / TRAINED}", markup=False, highlight=False)

    def _draw_episode(self, result: "Comparison", folder: Path) -> None:
        from agents.comparison.tracks import record_track
        from agents.figures.canvas import save_figure
        from agents.figures.tracks import track_figure

        found = result.largest_difference()
        if found is None:
            return
        best, episode = found
        plan, seed = result.plan, self.seed + episode
        records = []
        for entry in (result.entries[0], best):
            family = entry.curve.family
            decider = family.make(family.thresholds[entry.chosen])
            options = plan.options | family.options
            name = entry.name.replace("$", r"\$")  # Matplotlib would read it as a formula
            records.append(record_track(name, decider, plan.env_id, seed, **options))
        title = (
            f"{plan.env_id.rpartition(':')[2]}, seed {seed}: "
            f"largest difference in reward among {plan.episodes:,} episodes"
        )
        rewards = ", ".join(f"{record.name} {record.summary}" for record in records)
        title += f"\nMean reward per segment: {rewards}"
        save_figure(track_figure(records, result.world.radii, title), folder / "episode.png")
