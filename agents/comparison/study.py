"""Comparison of deciders: training where requested, threshold sweeps, and evaluation on common episodes."""

import functools
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

from agents.comparison.continuation import Continuation, weights_digest
from agents.comparison.plan import Plan
from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.operating_curve import (
    ACCURACY,
    REWARD,
    TICKS,
    Estimate,
    OperatingCurve,
    at_threshold,
    error_at_ticks,
    sweep,
    ticks_at_accuracy,
)
from agents.interface.decider_colours import name_without_seed
from agents.interface.parallel import Call, Workers
from agents.training.checkpoint import has_checkpoint
from agents.training.recipe import Recipe
from agents.training.run import TrainingProgress
from agents.training.runs import make_run
from baselines.rules import seeds
from baselines.rules.posterior_paths import PosteriorPaths, simulate_posterior_paths, summarise_calibration
from hybrid_env.options import WorldOptions

ACCURACY_LEVELS = (0.95, 0.98)
CALIBRATION_TICKS = (2, 5, 10, 20, 40)


@dataclass(frozen=True)
class Entry:
    """Results of one decider.

    Attributes:
        curve: operating curve on the reported episodes.
        chosen: index of the threshold that was selected on the selection episodes.
        accuracy: share of correct decisions at that threshold.
        ticks: mean decision time at that threshold.
        reward: mean reward per segment at that threshold.
        rmse: root-mean-square error of the position at that threshold [m].
        error_at_reference_ticks: error rate at the mean decision time of the reference.
        ticks_at: mean decision time at each accuracy of `ACCURACY_LEVELS`.
        error_after: error rates after a correct and after a wrong previous decision; NaN if there is none.
    """

    curve: OperatingCurve
    chosen: int
    accuracy: Estimate
    ticks: Estimate
    reward: Estimate
    rmse: Estimate
    error_at_reference_ticks: Estimate
    ticks_at: dict[float, Estimate]
    error_after: tuple[float, float]

    @property
    def name(self) -> str:
        """Name of the decider in tables and figures."""
        return self.curve.family.name


@dataclass(frozen=True)
class Comparison:
    """Result of a comparison.

    Attributes:
        plan: settings.
        world: options of the environment.
        reference_ticks: mean decision time of the reference at its default threshold, in ticks.
        entries: results of each decider; the first is the reference.
        posterior_paths: segments without early decisions, for the calibration of the bank; None before all
            deciders are evaluated.
    """

    plan: Plan
    world: WorldOptions
    reference_ticks: float
    entries: tuple[Entry, ...]
    posterior_paths: PosteriorPaths | None

    def calibration_rows(self) -> list[dict[str, float]]:
        """Calibration of the bank's posterior after a number of ticks without a decision.

        The keys of a row are "ticks", "right" (accuracy of the most probable hypothesis or type), "stated"
        (its mean posterior) and "worst" (the largest calibration error: posterior minus accuracy in a bin).
        """
        if self.posterior_paths is None:
            return []
        return [
            {"ticks": tick, **asdict(summarise_calibration(self.posterior_paths, tick))}
            for tick in CALIBRATION_TICKS
            if (self.posterior_paths.length >= tick).any()
        ]

    def seed_groups(self) -> dict[str, list[Entry]]:
        """Entries by name; those whose names differ only in the training seed form one group."""
        groups: dict[tuple[str, str, int], list[Entry]] = {}
        for entry in self.entries:
            name = name_without_seed(entry.name)
            thresholds = len(entry.curve.family.thresholds)
            groups.setdefault((name, entry.curve.family.symbol, thresholds), []).append(entry)
        return {entries[0].name if len(entries) == 1 else key[0]: entries for key, entries in groups.items()}

    @property
    def learned(self) -> tuple[Entry, ...]:
        """Entries of the learned agents."""
        return self.entries[len(self.plan.deciders) :]

    def largest_difference(self) -> tuple[Entry, int] | None:
        """The best agent, and the episode on which it differs most from the reference.

        Returns:
            The entry of the agent with the largest mean reward, and the index of the episode with the largest
            difference of rewards; None without agents.
        """
        if not self.learned:
            return None
        best = max(self.learned, key=lambda entry: entry.reward.value)
        rewards = [entry.curve.decisions[entry.chosen].reward.mean(1) for entry in (best, self.entries[0])]
        return best, int(np.abs(rewards[0] - rewards[1]).argmax())

    def differences(self, entry: Entry) -> dict[str, Estimate]:
        """Paired differences between an entry and the reference."""
        reference = self.entries[0]
        found = {
            "reward": entry.curve.difference(
                reference.curve, at_threshold(REWARD, entry.chosen), at_threshold(REWARD, reference.chosen)
            )
        }
        if self.plan.curves and all(np.isfinite(one.ticks_at[0.98].value) for one in (entry, reference)):
            found["ticks_at_98"] = entry.curve.difference(reference.curve, ticks_at_accuracy(0.98))
        return found

    def as_json(self) -> dict[str, Any]:
        """Contents of the tables and figures, with every point of the curves."""
        return {
            "plan": asdict(self.plan),
            "complete": self.posterior_paths is not None,
            "selection": {"seed": seeds.SELECTION, "episodes": self.plan.selection_episodes},
            "equal_time": self.reference_ticks,
            "segments": int(self.entries[0].curve.decisions[0].correct.size),
            "bank": [
                {name: value if np.isfinite(value) else None for name, value in row.items()}
                for row in self.calibration_rows()
            ],
            "deciders": [self._entry_json(entry) for entry in self.entries],
        }

    def _entry_json(self, entry: Entry) -> dict[str, Any]:
        family = entry.curve.family
        means = entry.curve.means
        times: dict[str, Any] = {}
        if self.plan.curves:
            times["equal_time_error"] = entry.error_at_reference_ticks.as_json()
            at = {f"{level:g}": entry.ticks_at[level].as_json() for level in ACCURACY_LEVELS}
            times["ticks_at_accuracy"] = at
        return {
            "name": entry.name,
            "threshold": {"symbol": family.symbol, "chosen": family.thresholds[entry.chosen]},
            **{name: getattr(entry, name).as_json() for name in ("accuracy", "ticks", "reward", "rmse")},
            **times,
            "error_after": [share if np.isfinite(share) else None for share in entry.error_after],
            "against_reference": {
                name: figure.as_json()
                for name, figure in self.differences(entry).items()
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


def compare(
    plan: Plan,
    progress: Progress,
    folder: Path | None = None,
    on_entry: Callable[[Comparison], None] | None = None,
) -> Comparison:
    """Train, evaluate and compare the deciders of a plan.

    Args:
        plan: settings.
        progress: display.
        folder: for the agents that are trained and, until the comparison is complete, for the decisions of
            each decider. A comparison that was interrupted and is started again goes on from there, with the
            same results. None writes nothing.
        on_entry: called after each decider with the comparison of those so far.
    """
    continuation = Continuation(plan, folder)
    families: list[tuple[DeciderFamily, str]] = []
    for decider, found in zip((*plan.deciders, *plan.agents), plan.families(), strict=True):
        if isinstance(found, Recipe):
            numbers = range(plan.training_seeds)
            families += [_train(found, plan, number, progress, continuation) for number in numbers]
        else:
            families.append((found, weights_digest(decider)))
    world = plan.world()
    total = sum(2 * len(family.thresholds) + 1 for family, _ in families)
    task = progress.add_task("Evaluating", total=total, note="")
    reference_ticks = np.nan
    entries: list[Entry] = []
    for family, weights in families:
        progress.update(task, note=family.name)
        before = progress.tasks[task].completed
        swept = continuation.load(family, weights)
        if swept is None:
            swept = _sweep(
                family, plan, full=plan.curves or not entries, on_progress=lambda: progress.advance(task)
            )
            continuation.save(family, weights, *swept)
        curve, chosen = swept
        if not entries:
            default = curve.family.thresholds.index(curve.family.default)
            reference_ticks = float(curve.means[TICKS, default])
        entries.append(_entry(curve, chosen, reference_ticks))
        progress.update(task, completed=before + 2 * len(family.thresholds) + 1)
        if on_entry is not None:
            on_entry(Comparison(plan, world, reference_ticks, tuple(entries), None))
    progress.update(task, note="")
    paths = simulate_posterior_paths(plan.episodes, plan.seed, max(CALIBRATION_TICKS), **vars(world))
    continuation.finish()
    return Comparison(plan, world, reference_ticks, tuple(entries), paths)


def evaluate_ahead(plan: Plan, folder: Path, workers: Workers, progress: Progress) -> None:
    """Train and evaluate the deciders of a plan in parallel; `compare` then goes on from their files.

    Args:
        plan: settings.
        folder: of `compare`; on a cluster, one that all machines share.
        workers: where the work runs.
        progress: display.
    """
    calls: dict[tuple[int, int], Call] = {}
    for position, found in enumerate(plan.families()):
        for number in range(plan.training_seeds if isinstance(found, Recipe) else 1):
            calls[position, number] = functools.partial(_evaluate_one, plan, folder, position, number)
    names = (*plan.deciders, *plan.agents)
    task = progress.add_task("In parallel", total=len(calls), note="")
    longest_first = dict(reversed(calls.items()))  # agents, which are trained or slow
    for _ in workers.results(
        longest_first, lambda call: progress.update(task, advance=1, note=names[call[0]])
    ):
        pass
    progress.update(task, note="")


def _evaluate_one(plan: Plan, folder: Path, position: int, number: int) -> None:
    """Train if needed and evaluate the decider at a position of a plan, unless its file exists."""
    continuation = Continuation(plan, folder)
    name, found = (*plan.deciders, *plan.agents)[position], plan.families()[position]
    if isinstance(found, Recipe):
        family, weights = _train(found, plan, number, Progress(disable=True), continuation)
    else:
        family, weights = found, weights_digest(name)
    if continuation.load(family, weights) is None:
        swept = _sweep(family, plan, full=plan.curves or position == 0, on_progress=lambda: None)
        continuation.save(family, weights, *swept)


def _sweep(
    family: DeciderFamily, plan: Plan, full: bool, on_progress: Callable[[], None]
) -> tuple[OperatingCurve, int]:
    """Return the operating curve on the reported episodes and the index of the selected threshold.

    Args:
        family: of the decider.
        plan: settings.
        full: False evaluates the selected threshold only.
        on_progress: called after each threshold.
    """
    arguments: dict[str, Any] = {"on_progress": on_progress, **plan.options}
    selection = sweep(family, plan.env_id, plan.selection_episodes, seeds.SELECTION, **arguments)
    wanted = plan.accuracy
    index = selection.best_index() if wanted is None else selection.fastest_index(wanted)
    if not full:
        family, index = replace(family, thresholds=(family.thresholds[index],)), 0
    return sweep(family, plan.env_id, plan.episodes, plan.seed, **arguments), index


def _train(
    recipe: Recipe, plan: Plan, number: int, progress: Progress, continuation: Continuation
) -> tuple[DeciderFamily, str]:
    """Train an agent, or go on with its training; return its family and the digest of its weights."""
    name = recipe.name if plan.training_seeds == 1 else f"{recipe.name} seed {number}"
    folder = continuation.run_folder(recipe, number)
    resume = folder is not None and has_checkpoint(folder)
    run = make_run(plan.env_id, plan.options, recipe, number, folder, plan.steps, resume)
    task = progress.add_task(f"Training {name}", total=run.steps, note="")

    def show(now: TrainingProgress) -> None:
        progress.update(task, completed=min(now.steps, now.total), note=now.note)

    run.train(show)
    progress.update(task, completed=run.steps)
    return run.family(name), "" if folder is None else weights_digest(str(folder))


def _entry(curve: OperatingCurve, chosen: int, reference_ticks: float) -> Entry:
    decisions = curve.decisions[chosen]
    summary = decisions.summary()["rmse"]
    return Entry(
        curve,
        chosen,
        curve.estimate_share(at_threshold(ACCURACY, chosen)),
        curve.estimate(at_threshold(TICKS, chosen)),
        curve.estimate(at_threshold(REWARD, chosen)),
        Estimate(summary["mean"], *summary["interval"]),
        curve.estimate_share(error_at_ticks(reference_ticks)),
        {level: curve.estimate(ticks_at_accuracy(level)) for level in ACCURACY_LEVELS},
        decisions.error_after(),
    )
