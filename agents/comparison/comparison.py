"""What a comparison has found: figures of all deciders beside each other, tables, picture and
plain values.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from agents.evaluation.curves import comparison_figure
from agents.evaluation.registry import find_decider
from agents.evaluation.report import Result, metrics_table, scores_table
from agents.evaluation.task import Metric
from agents.interface.output_files import finite
from baselines.rules import seeds
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores


@dataclass(frozen=True, eq=False)
class Comparison:
    """Results of a comparison."""

    # With all its values, see `Plan.completed`.
    plan: Any
    # Results of all deciders; the first is the reference.
    entries: Sequence[Result]
    # See `bound_scores`.
    bound: Scores | None

    @cached_property
    def levels(self) -> tuple[Metric, ...]:
        """Figures of whole operating curves, see `Task.levels`; none without curves."""
        task, first = self.plan.task, self.entries[0]
        if not self.plan.curves:
            return ()
        levels: tuple[Metric, ...] = task.levels(
            first.scores, find_decider(first.decider, task.options).default
        )
        return levels

    @cached_property
    def at_levels(self) -> dict[str, dict[str, Estimate]]:
        """The figures of the whole curve of each decider, by its name and theirs."""
        return {
            entry.name: {
                metric.name: entry.scores.estimate(metric.statistic) for metric in self.levels
            }
            for entry in self.entries
        }

    @cached_property
    def against(self) -> dict[str, dict[str, Estimate]]:
        """Of each decider the paired differences of the same figures to the reference, or the
        ratios with unknown switches, where both reach the level.
        """
        first = self.entries[0]
        compare = Scores.difference if self.plan.task.waits else Scores.ratio
        reached = {
            name: {key for key, estimate in values.items() if np.isfinite(estimate.value)}
            for name, values in self.at_levels.items()
        }
        return {
            entry.name: {
                metric.name: compare(entry.scores, first.scores, metric.statistic)
                for metric in self.levels
                if metric.name in reached[entry.name] & reached[first.name]
            }
            for entry in self.entries[1:]
        }

    @cached_property
    def best_rule(self) -> Result:
        """The rule with the best reward on the selection episodes; without rules the
        reference.
        """
        rules = [entry for entry in self.entries if not entry.learned]
        return max(rules or self.entries[:1], key=lambda entry: entry.selected)

    @cached_property
    def of_bound(self) -> dict[str, Estimate]:
        """The reward of the bound, and less that of the best rule; empty without a bound."""
        if self.bound is None:
            return {}
        reward, best = self.plan.task.statistic("reward"), self.best_rule
        less = self.bound.difference(best.scores, reward, 0, best.chosen)
        return {"reward": self.bound.estimate(reward, 0), "less": less}

    @property
    def seed_groups(self) -> dict[str, list[Result]]:
        """Results by name; those of one recipe, with different training seeds, are one group."""
        groups: dict[str, list[Result]] = {}
        for entry in self.entries:
            groups.setdefault(self.plan.looked_up[entry.decider][0], []).append(entry)
        return groups

    def picture(self) -> Figure:
        """Return the figure of the operating curves."""
        bound = self.of_bound["reward"].value if self.of_bound else None
        return comparison_figure(self.plan.task, self.seed_groups, bound)

    def as_json(self) -> dict[str, Any]:
        """Return the contents of tables and figures for `write_json`, with every point of the
        curves.
        """
        task = self.plan.task
        deciders = []
        for entry in self.entries:
            curves = {
                metric.name: finite(entry.scores.curve(metric.statistic)) for metric in task.metrics
            }
            deciders.append(
                {
                    **entry.as_json(),
                    "reward_less_best_rule": entry.less(self.best_rule),
                    **self.at_levels[entry.name],
                    "against_reference": self.against.get(entry.name, {}),
                    "curve": {"thresholds": list(entry.scores.thresholds), **curves},
                }
            )
        return {
            "plan": self.plan.settings,
            "selection": {"seed": seeds.SELECTION, "episodes": self.plan.selection_episodes},
            "best_rule": self.best_rule.name,
            "bound": self.of_bound,
            "deciders": deciders,
        }

    def tables(self) -> Iterator[Table]:
        """Return the metrics at the selected thresholds, and figures of whole curves."""
        plan, task = self.plan, self.plan.task
        title = f"{task.title}: {task.size(plan.episodes)}, common to all"
        notes = "Thresholds for the best reward, selected on other episodes.\n"
        yield scores_table(self.entries, self.best_rule, title, notes, self.of_bound)
        if plan.curves:
            yield self._levels_table()
        spread = {
            f"{group}, {len(entries)} seeds": self._spread(entries)
            for group, entries in self.seed_groups.items()
            if len(entries) > 1
        }
        if spread:
            title = "Mean over training seeds, ± half the range"
            yield metrics_table(title, (*task.shown, *self.levels), spread)

    def _levels_table(self) -> Table:
        """Return figures of whole operating curves, and paired figures of each decider and the
        reference.
        """
        difference = self.plan.task.waits
        kind, words = ("diff.", "less") if difference else ("ratio", "to")
        paired = [
            replace(
                metric,
                name=f"{kind} {metric.name}",
                head=f"{kind}\n{metric.head}",
                digits=metric.digits if difference else 3,
                scale=metric.scale if difference else 1.0,
            )
            for metric in self.levels
        ]
        rows = {
            name: values
            | {f"{kind} {key}": value for key, value in self.against.get(name, {}).items()}
            for name, values in self.at_levels.items()
        }
        notes = (
            "Interpolated between thresholds. ± half width of the 95 % confidence interval.\n"
            f"{kind}: {words} that of {self.entries[0].name} on the same episodes."
        )
        return metrics_table("On the operating curves", (*self.levels, *paired), rows, notes)

    def _spread(self, entries: Sequence[Result]) -> dict[str, Estimate]:
        """Return the mean and the range of all figures over training seeds, by name."""
        every = [entry.estimates | self.at_levels[entry.name] for entry in entries]
        values = {name: [figures[name].value for figures in every] for name in every[0]}
        return {
            name: Estimate(float(np.mean(some)), min(some), max(some))
            for name, some in values.items()
        }

    def lines(self) -> Iterator[str]:
        """Yield which episode is worth a look, with the best agent or without one the best rule."""
        first = self.entries[0]
        agents = [entry for entry in self.entries if entry.learned]
        best = max(agents, key=lambda entry: entry.selected) if agents else self.best_rule
        if best is not first:
            mine, other = (entry.scores.of("reward", entry.chosen) for entry in (best, first))
            seed = self.plan.seed + int(np.abs(mine - other).argmax())
            yield f"{best.name} and {first.name} differ most with `hybridtrack play --seed {seed}`"
