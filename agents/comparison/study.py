"""Deciders side by side: trained where asked, swept over their thresholds, measured on the same episodes."""

import re
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

from agents.evaluation import seeds
from agents.evaluation.deciders import CLASSICAL_NAMES, SHIPPED, DeciderFamily, check_family, decider_family
from agents.evaluation.operating_curve import (
    ACCURACY,
    REWARD,
    TICKS,
    Figure,
    OperatingCurve,
    at_threshold,
    error_at_ticks,
    sweep,
    ticks_at_accuracy,
)
from agents.training.recipe import Recipe, load_recipe, recipe_names
from agents.training.run import TrainingProgress
from agents.training.runs import make_run
from baselines.deciders.posterior_paths import PosteriorPaths, simulate_posterior_paths, summarise_calibration
from hybrid_env.checks import reject
from hybrid_env.options import WorldOptions
from hybrid_env.registration import make_vector_env

LEVELS = (0.95, 0.98)
SEED_SUFFIX = r"([ -]seed ?\d+)$"
BANK_TICKS = (2, 5, 10, 20, 40)


@dataclass(frozen=True)
class Plan:
    """What is compared, on what.

    Attributes:
        env_id, options: the world.
        deciders: classical names; the first is the reference.
        agents: recipes to train by, 'shipped', or run folders.
        episodes, seed: that the figures are reported on.
        steps: of each training, None as many as its recipe has.
        training_seeds: agents of each recipe.
        accuracy: wanted of every decider, the sooner the better; None chooses thresholds for the reward.
        selection_episodes: that thresholds are chosen on, from another seed on.
        curves: False reports all but the reference at the chosen threshold only.
    """

    env_id: str
    options: dict[str, Any]
    deciders: tuple[str, ...]
    agents: tuple[str, ...]
    episodes: int
    seed: int
    steps: int | None
    training_seeds: int
    accuracy: float | None = None
    curves: bool = True
    selection_episodes: int = seeds.SELECTION_EPISODES

    def world(self) -> WorldOptions:
        """The options of the world, the id's own included."""
        return make_vector_env(self.env_id, 1, **self.options).options

    def families(self) -> list[DeciderFamily | Recipe]:
        """What is compared: families of deciders, and recipes of agents that are to be trained.

        Raises:
            ArgumentError: an unknown name or option, or a policy for another bank.
        """
        world = self.world()
        found: list[DeciderFamily | Recipe] = []
        for name in self.deciders:
            if name not in CLASSICAL_NAMES:
                raise reject("deciders", name, ", ".join(CLASSICAL_NAMES))
            found.append(decider_family(name, world))
        for name in self.agents:
            if name in recipe_names() or name.endswith(".yml"):
                found.append(load_recipe(name, self.env_id))
                continue
            if name != SHIPPED and not Path(name).is_dir():
                allowed = f"'shipped', a run folder, a recipe as YAML, or one of {', '.join(recipe_names())}"
                raise reject("agents", name, allowed)
            family = decider_family(name, world)
            check_family(family, name, world)
            found.append(family)
        return found


@dataclass(frozen=True)
class Entry:
    """One decider's figures.

    Attributes:
        curve: on the reported episodes.
        chosen: index of the threshold chosen on the selection episodes.
        accuracy, ticks, reward, rmse: at that threshold.
        equal_time_error: share of wrong decisions at the reference's mean time.
        time_at: mean ticks at each accuracy of `LEVELS`.
        error_after: share of wrong decisions after a right and after a wrong previous one, NaN without any.
    """

    curve: OperatingCurve
    chosen: int
    accuracy: Figure
    ticks: Figure
    reward: Figure
    rmse: Figure
    equal_time_error: Figure
    time_at: dict[float, Figure]
    error_after: tuple[float, float]

    @property
    def name(self) -> str:
        """As tables show it."""
        return self.curve.family.name


@dataclass(frozen=True)
class Comparison:
    """The result: one entry a decider, the first of them the reference."""

    plan: Plan
    world: WorldOptions
    equal_time: float
    entries: tuple[Entry, ...]
    waited: PosteriorPaths

    def bank_rows(self) -> list[dict[str, float]]:
        """What the bank says after some ticks, if no one decides before."""
        return [
            {"ticks": tick, **asdict(summarise_calibration(self.waited, tick))}
            for tick in BANK_TICKS
            if (self.waited.length >= tick).any()
        ]

    def by_kind(self) -> dict[str, list[Entry]]:
        """The entries, those together whose names differ only in the seed of their training."""
        kinds: dict[tuple[str, str, int], list[Entry]] = {}
        for entry in self.entries:
            name = re.sub(SEED_SUFFIX, "", entry.name)
            thresholds = len(entry.curve.family.thresholds)
            kinds.setdefault((name, entry.curve.family.symbol, thresholds), []).append(entry)
        return {entries[0].name if len(entries) == 1 else key[0]: entries for key, entries in kinds.items()}

    @property
    def learned(self) -> tuple[Entry, ...]:
        """The entries of agents."""
        return self.entries[len(self.plan.deciders) :]

    def widest(self) -> tuple[Entry, int] | None:
        """The best agent, and the episode on which it differs most from the reference; None without one."""
        if not self.learned:
            return None
        best = max(self.learned, key=lambda entry: entry.reward.value)
        rewards = [entry.curve.decisions[entry.chosen].reward.mean(1) for entry in (best, self.entries[0])]
        return best, int(np.abs(rewards[0] - rewards[1]).argmax())

    def gains(self, entry: Entry) -> dict[str, Figure]:
        """Paired differences of an entry to the reference."""
        reference = self.entries[0]
        gains = {
            "reward": entry.curve.difference(
                reference.curve, at_threshold(REWARD, entry.chosen), at_threshold(REWARD, reference.chosen)
            )
        }
        if self.plan.curves and all(np.isfinite(one.time_at[0.98].value) for one in (entry, reference)):
            gains["ticks_at_98"] = entry.curve.difference(reference.curve, ticks_at_accuracy(0.98))
        return gains

    def as_json(self) -> dict[str, Any]:
        """Everything that table and figure show, and every point of the curves."""
        return {
            "plan": asdict(self.plan),
            "selection": {"seed": seeds.SELECTION, "episodes": self.plan.selection_episodes},
            "equal_time": self.equal_time,
            "segments": int(self.entries[0].curve.decisions[0].correct.size),
            "bank": [
                {name: value if np.isfinite(value) else None for name, value in row.items()}
                for row in self.bank_rows()
            ],
            "deciders": [self._entry_json(entry) for entry in self.entries],
        }

    def _entry_json(self, entry: Entry) -> dict[str, Any]:
        family = entry.curve.family
        means = entry.curve.means
        names = ["accuracy", "ticks", "reward", "rmse"]
        times: dict[str, Any] = {}
        if self.plan.curves:
            names.append("equal_time_error")
            at = {f"{level:g}": entry.time_at[level].as_json() for level in LEVELS}
            times = {"ticks_at_accuracy": at}
        return {
            "name": entry.name,
            "threshold": {"symbol": family.symbol, "chosen": family.thresholds[entry.chosen]},
            **{name: getattr(entry, name).as_json() for name in names},
            **times,
            "error_after": [share if np.isfinite(share) else None for share in entry.error_after],
            "against_reference": {
                name: figure.as_json()
                for name, figure in self.gains(entry).items()
                if entry is not self.entries[0]
            },
            "curve": {
                "thresholds": list(family.thresholds),
                "accuracy": means[ACCURACY].tolist(),
                "ticks": means[TICKS].tolist(),
                "reward": means[REWARD].tolist(),
                "rmse": [decisions.rmse for decisions in entry.curve.decisions],
            },
        }


def compare(plan: Plan, progress: Progress) -> Comparison:
    """Carry out a plan, showing how it goes on."""
    families: list[DeciderFamily] = []
    for found in plan.families():
        if isinstance(found, Recipe):
            families += [_train(found, plan, number, progress) for number in range(plan.training_seeds)]
        else:
            families.append(found)
    total = sum(2 * len(family.thresholds) for family in families)
    task = progress.add_task("Evaluating", total=total, note="")
    curves: list[OperatingCurve] = []
    chosen = []
    for family in families:
        progress.update(task, note=family.name)
        arguments: dict[str, Any] = {"on_progress": lambda: progress.advance(task), **plan.options}
        selection = sweep(family, plan.env_id, plan.selection_episodes, seeds.SELECTION, **arguments)
        wanted = plan.accuracy
        index = selection.best_index() if wanted is None else selection.soonest_index(wanted)
        if not plan.curves and curves:
            progress.advance(task, len(family.thresholds) - 1)
            family, index = replace(family, thresholds=(family.thresholds[index],)), 0
        chosen.append(index)
        curves.append(sweep(family, plan.env_id, plan.episodes, plan.seed, **arguments))
    progress.update(task, note="")
    reference = curves[0].family
    default = reference.thresholds.index(reference.default)
    equal_time = float(curves[0].means[TICKS, default])
    task = progress.add_task("Intervals", total=len(curves), note="")
    entries = []
    for curve, index in zip(curves, chosen, strict=True):
        entries.append(_entry(curve, index, equal_time))
        progress.advance(task)
    world = plan.world()
    waited = simulate_posterior_paths(plan.episodes, plan.seed, max(BANK_TICKS), **vars(world))
    return Comparison(plan, world, equal_time, tuple(entries), waited)


def _train(recipe: Recipe, plan: Plan, number: int, progress: Progress) -> DeciderFamily:
    name = recipe.name if plan.training_seeds == 1 else f"{recipe.name} seed {number}"
    run = make_run(plan.env_id, plan.options, recipe, number, steps=plan.steps)
    task = progress.add_task(f"Training {name}", total=run.steps, note="")

    def show(now: TrainingProgress) -> None:
        progress.update(task, completed=min(now.steps, now.total), note=now.note)

    run.train(show)
    return run.family(name)


def _entry(curve: OperatingCurve, chosen: int, equal_time: float) -> Entry:
    decisions = curve.decisions[chosen]
    summary = decisions.summary()["rmse"]
    return Entry(
        curve,
        chosen,
        curve.figure(at_threshold(ACCURACY, chosen)),
        curve.figure(at_threshold(TICKS, chosen)),
        curve.figure(at_threshold(REWARD, chosen)),
        Figure(summary["mean"], *summary["interval"]),
        curve.figure(error_at_ticks(equal_time)),
        {level: curve.figure(ticks_at_accuracy(level)) for level in LEVELS},
        decisions.error_after(),
    )
