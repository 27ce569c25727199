"""The plan of a comparison: which deciders meet on which episodes, and the work."""

import dataclasses
import functools
import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import tyro
from rich.progress import Progress

from agents.evaluation.bound import bound_scores
from agents.evaluation.cells import counted
from agents.evaluation.registry import (
    check_name,
    distinct_titles,
    find_decider,
    is_learned,
    parse_name,
    shipped_names,
)
from agents.evaluation.report import Result
from agents.evaluation.task import Task, sweep, task_of
from agents.interface.help_texts import shown_default
from agents.interface.parallel import Workers
from agents.interface.progress import calls_shown
from agents.interface.world_arguments import TrustArguments, WorldArguments
from agents.training.recipe import load_recipe, package_recipes
from baselines.rules import seeds
from baselines.rules.decider import Decider
from hybrid_env.checks import Count, NotNegative, checked, declared_fields, reject

if TYPE_CHECKING:
    from agents.comparison.comparison import Comparison


@dataclass(kw_only=True)
class Plan(WorldArguments, TrustArguments, Workers):
    """What is compared, as flags."""

    deciders: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        tyro.conf.arg(metavar="[DECIDER ...]"),
        shown_default("the usual rules of the environment, ppo if switches are announced, shipped"),
    ] = ()
    """What is compared; the first is the reference. Rules, announced switches: {announced}; unknown
    switches: {unknown}. Rules of your own: 'mine.py:MyRule'. Agents: 'shipped' or 'robust' (weights
    in the package), run folders, 'model.zip', or recipes to train now: 'ppo', 'dqn' ...
    """
    curves: bool = True
    """Score every decider at every threshold; without curves, all but the reference at their
    selected one only, in half the time.
    """
    episodes: Annotated[Count | None, shown_default("1500; 500 for unknown switches")] = None
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

    @cached_property
    def task(self) -> Task:
        """What is decided, in which environment."""
        return task_of(self.env_id, self.world_options())

    @property
    def settings(self) -> dict[str, Any]:
        """Plain values of what determines the results."""
        names = (
            "deciders",
            "episodes",
            "seed",
            "selection_episodes",
            "steps",
            "training_seeds",
            "curves",
        )
        values = {name: getattr(self, name) for name in names}
        return {"env_id": self.task.env_id, "options": dict(self.task.given), **values}

    def completed(self) -> "Plan":
        """Return the plan with the usual values of the environment where none are given.

        Raises:
            ArgumentError: a value is not allowed.
        """
        for name, hint in declared_fields(Plan).items():
            # Deciders may also be functions.
            if name in {*self.settings, "jobs", "engine"} - {"deciders"}:
                checked(name, getattr(self, name), hint)
        self.check_names()
        task = self.task
        usual: dict[str, Any] = {
            name: getattr(task, name)
            for name in ("episodes", "selection_episodes")
            if getattr(self, name) is None
        }
        deciders = self.deciders or (*task.deciders, *task.recipes, *task.shipped)
        plan: Any = dataclasses.replace(self, deciders=deciders, **usual)
        if self.seed + plan.episodes > seeds.SELECTION:
            allowed = f"at most {seeds.SELECTION} minus the number of episodes"
            raise reject("seed", self.seed, allowed)
        if any(deciders.count(name) > 1 for name in deciders):
            raise reject("deciders", deciders, "different names")
        # Before any file is written.
        task.check_episodes("episodes", plan.episodes)
        task.check_episodes("selection-episodes", plan.selection_episodes)
        # Looks every name up.
        assert plan.looked_up
        return cast("Plan", plan)

    def check_names(self) -> None:
        """Refuse names that do not exist, before anything is loaded."""
        for name in self.deciders:
            if parse_name(name).threshold is not None:
                raise reject("decider", name, "a name without a threshold: all are compared")
            if not str(name).endswith((".yml", ".yaml")):
                check_name(name, self.task.switches, [*package_recipes()])

    def find(self, name: Any) -> Any:
        """Return a decider, or the recipe of an agent still to be trained."""
        is_recipe = name in [*package_recipes()] and name not in shipped_names(self.task.switches)
        if is_recipe or str(name).endswith((".yml", ".yaml")):
            return load_recipe(name, self.task.env_id, own_modes="modes" in self.task.given)
        return find_decider(name, self.task.options)

    @cached_property
    def looked_up(self) -> dict[Any, tuple[str, bool]]:
        """Title of each decider by name, see `distinct_titles`, those of agents without training
        seeds; and whether it is still to be trained.
        """
        every = [self.find(name) for name in self.deciders]
        trained = [not isinstance(each, Decider) for each in every]
        titles = distinct_titles(self.deciders, [each.title for each in every])
        described = zip(titles, trained, strict=True)
        return dict(zip(self.deciders, described, strict=True))

    def compare(self, folder: Path | None, progress: Progress) -> "Comparison":
        """Train and score the deciders of a plan.

        The folder keeps trained agents: a comparison that was interrupted goes on with them, with
        the same results.
        """
        # Matplotlib; a wrong name is refused sooner.
        from agents.comparison.comparison import Comparison

        trained = {name: train for name, (_, train) in self.looked_up.items()}
        planned = [
            (name, seed)
            for name in self.deciders
            for seed in range(self.training_seeds if trained[name] else 1)
        ]
        # Training takes longest: it begins first, so that no process waits for it at the end.
        order = sorted(planned, key=lambda call: not trained[call[0]])
        title = f"Comparing {counted(len(order), 'decider')}"
        with calls_shown(progress, title, len(order)) as reports:
            said = dict(zip(order, reports, strict=True))
            calls: dict[tuple[Any, int], Callable[[], Any]] = {
                call: functools.partial(self.score, folder, *call, said[call]) for call in order
            }
            scored = dict(self.results(calls, lambda call: said[call]("", 1.0)))
        bound = None
        if self.task.waits:
            bound = bound_scores(self.task, self.episodes or 0, self.seed)
        return Comparison(self, [scored[call] for call in planned], bound)

    def score(
        self, folder: Path | None, name: Any, seed: int, report: Callable[[str, float], None]
    ) -> Result:
        """Train a decider if needed, select its threshold and score it; return it with its name,
        or with its run folder if it was trained.
        """
        decider, run_folder = self.find(name), None
        title, train = self.looked_up[name]
        # Share of the call that the training takes.
        before = 0.0
        if train:
            before = 0.7
            title += f" seed {seed}" if self.training_seeds > 1 else ""
            decider, run_folder = self._train(decider, seed, title, folder, report, before)
        decider = decider.changed(title=title)
        task, episodes, to_select = self.task, self.episodes or 0, self.selection_episodes or 0
        middle = before + (1.0 - before) * to_select / (to_select + episodes)

        def selecting(share: float) -> None:
            report(f"Selecting the threshold of {title}", before + share * (middle - before))

        def scoring(share: float) -> None:
            report(f"Scoring {title}", middle + share * (1.0 - middle))

        selecting(0.0)
        selection = sweep(task, decider, to_select, seeds.SELECTION, selecting)
        scoring(0.0)
        index = task.best(selection)
        selected = float(selection.curve(task.statistic("reward"))[index])
        if not self.curves and name != self.deciders[0]:
            decider, index = decider.changed(thresholds=(decider.thresholds[index],)), 0
        scores = sweep(task, decider, episodes, self.seed, scoring)
        return Result(task, scores, index, name, selected, run_folder, is_learned(decider))

    def _train(
        self,
        recipe: Any,
        seed: int,
        title: str,
        folder: Path | None,
        report: Callable[[str, float], None],
        whole: float,
    ) -> tuple[Decider, Path | None]:
        """Train an agent, or go on with its training; return it and its run folder. The training
        is this share of the whole call.

        The name of the folder has a digest of all that determines the agent: those of other
        settings or versions are not used.
        """
        from agents.learned.policy_file import package_versions
        from agents.training.checkpoint import has_checkpoint
        from agents.training.runs import make_run

        env_id, options = self.task.env_id, dict(self.task.given)
        run_folder = None
        if folder is not None:
            settings = [env_id, options, self.steps, recipe.as_json(), package_versions()]
            digest = hashlib.sha256(json.dumps(settings, default=repr).encode()).hexdigest()
            run_folder = folder / "agents" / f"{recipe.name}-seed{seed}-{digest[:8]}"
        resume = run_folder is not None and has_checkpoint(run_folder)
        run = make_run(env_id, options, recipe, seed, run_folder, self.steps, resume)

        def training(now: Any) -> None:
            report(f"Training {title}", whole * min(now.steps / now.total, 1.0))

        report(f"Training {title}", 0.0)
        run.train(training)
        return run.agent(title), run_folder
