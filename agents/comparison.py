"""Deciders side by side: trained where asked, swept over their thresholds, measured on the same episodes."""

import re
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.progress import Progress
from rich.table import Table

from agents import seeds
from agents.deciders import CLASSICAL_NAMES, SHIPPED, DeciderFamily, check_family, decider_family
from agents.evaluation import make_vector_env
from agents.operating_curve import (
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
from agents.recipe import Recipe, load_recipe, recipe_names
from agents.runs import make_run
from agents.training import TrainingProgress
from baselines.waited_paths import Paths, at_tick, waited_paths
from hybrid_env.checks import reject
from hybrid_env.options import WorldOptions

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
    waited: Paths

    def table(self) -> Table:
        """For the terminal: each figure above the half width of its 95 % interval."""
        first = self.entries[0]
        segments = first.curve.decisions[0].correct.size
        wanted = self.plan.accuracy
        way = "Best-reward thresholds" if wanted is None else f"Thresholds for {wanted:.1%} accuracy"
        title = f"{self.plan.env_id.removeprefix('hybrid_env:')}: {segments:,} segments, the same for all"
        table = Table(
            title=title,
            min_width=len(title),
            caption=(
                f"{way} from other episodes; ± half of the 95 % interval.\n"
                f"{self.equal_time:.1f} ticks: {first.name} at its default threshold."
                if self.plan.curves
                else f"{way} from other episodes; ± half of the 95 % interval."
            ),
            box=box.SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
        )
        heads = ["decider", "accuracy\n%", "mean\nticks", "reward a\nsegment", "RMSE\nm"]
        if self.plan.curves:
            heads += [f"error at\n{self.equal_time:.1f} t, %"]
            heads += [f"{level:.0%}\nat tick" for level in LEVELS]
        table.add_column(heads[0], overflow="fold")  # long names give way, figures do not
        for head in heads[1:]:
            table.add_column(head, justify="right", no_wrap=True)
        for entry in self.entries:
            family = entry.curve.family
            table.add_row(
                f"{entry.name}\n[bright_black]{family.symbol} {family.thresholds[entry.chosen]:g}[/]",
                _cell(entry.accuracy, 100, 1), _cell(entry.ticks, 1, 1), _cell(entry.reward, 1, 3),
                _cell(entry.rmse, 1, 3), *self._curve_cells(entry),
            )  # fmt: skip
        return table

    def _curve_cells(self, entry: Entry) -> list[str]:
        if not self.plan.curves:
            return []
        times = [_cell(entry.time_at[level], 1, 1) for level in LEVELS]
        return [_cell(entry.equal_time_error, 100, 2), *times]

    def missed_accuracy(self) -> list[str]:
        """A line for each decider that no threshold took to the wanted accuracy on the reported episodes."""
        wanted = self.plan.accuracy
        return [
            f"{entry.name} does not reach {wanted:.1%}: its most accurate threshold is shown"
            for entry in self.entries
            if wanted is not None and self.plan.curves and entry.curve.means[ACCURACY].max() < wanted
        ]

    def error_table(self) -> Table:
        """How an error makes the next one likelier, by a spoiled anchor."""
        table = Table(title="Wrong decisions, %", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
        for head in ("decider", "after a right one", "after a wrong one"):
            table.add_column(head, justify="left" if head == "decider" else "right")
        for entry in self.entries:
            cells = [f"{100 * share:.1f}" if np.isfinite(share) else "-" for share in entry.error_after]
            table.add_row(entry.name, *cells)
        return table

    def bank_table(self) -> Table:
        """What the bank says after some ticks, if no one decides before."""
        table = Table(
            title=f"The {self.world.bank.replace('_', '-')} bank while all wait",
            caption="Worst: of bins of the stated with 1,000 segments or more.",
            box=box.SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
        )
        for head in ("after ticks", "likeliest is right, %", "it says, %", "stated less actual, worst, %"):
            table.add_column(head, justify="right")
        for row in self.bank_rows():
            table.add_row(
                f"{row['ticks']:g}", f"{100 * row['right']:.1f}", f"{100 * row['stated']:.1f}",
                f"{100 * row['worst']:+.1f}" if np.isfinite(row["worst"]) else "-",
            )  # fmt: skip
        return table

    def bank_rows(self) -> list[dict[str, float]]:
        """The figures of `bank_table`."""
        return [
            {"ticks": tick, **asdict(at_tick(self.waited, tick))}
            for tick in BANK_TICKS
            if (self.waited.length >= tick).any()
        ]

    def headlines(self) -> list[str]:
        """Every decider against the reference, paired on the same episodes."""
        reference = self.entries[0]
        lines = []
        for entry in self.entries[1:]:
            parts = []
            gain = self.gains(entry)
            parts.append(f"reward {_signed(gain['reward'], 3)} a segment")
            if "ticks_at_98" in gain:
                parts.append(f"{_signed(gain['ticks_at_98'], 1)} ticks at 98 % accuracy")
            lines.append(f"{entry.name} against {reference.name}: " + ", ".join(parts))
        for kind, trained in self.by_kind().items():
            if len(trained) < 2:
                continue
            spread = []
            figures = [("reward", 3, [entry.reward.value for entry in trained])]
            if self.plan.curves:
                for level in LEVELS:
                    times = [entry.time_at[level].value for entry in trained]
                    figures.append((f"{level:.0%} at tick", 1, times))
                errors = [100 * entry.equal_time_error.value for entry in trained]
                figures.append((f"error at {self.equal_time:.1f} ticks, %", 2, errors))
            for name, digits, values in figures:
                low, mean, high = np.min(values), np.mean(values), np.max(values)
                spread.append(f"{name} {mean:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})")
            lines.append(f"{kind} over {len(trained)} training seeds, mean and range: " + ", ".join(spread))
        return lines

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


def _cell(figure: Figure, scale: float, digits: int) -> str:
    if not np.isfinite(figure.value):
        return "not\nreached"
    value = f"{scale * figure.value:.{digits}f}"
    if not np.isfinite(figure.high):
        return f"{value}\n[bright_black]> {scale * figure.low:.{digits}f}[/]"
    return f"{value}\n[bright_black]±{scale * (figure.high - figure.low) / 2:.{digits}f}[/]"


def _signed(figure: Figure, digits: int) -> str:
    return f"{figure.value:+.{digits}f} [{figure.low:+.{digits}f}, {figure.high:+.{digits}f}]"


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
    waited = waited_paths(plan.episodes, plan.seed, max(BANK_TICKS), **vars(world))
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
