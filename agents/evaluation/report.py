"""Results of deciders: their scores at the selected threshold, as tables and as plain values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import estimate_cell, filled_table
from agents.evaluation.task import Metric, Task
from agents.interface.output_files import finite
from baselines.rules.fixed_time import NO_EARLY_DECISION
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores
from hybrid_env.rendering.evidence import mode_name


@dataclass(frozen=True, eq=False)
class Result:
    """Scores of one decider on the reported episodes, and its threshold."""

    # What is decided.
    task: Task
    # At all thresholds, or at the only one.
    scores: Scores
    # Index of the threshold that was selected on other episodes.
    chosen: int = 0
    # Its name on the command line, or the object itself.
    decider: Any = ""
    # The mean reward at that threshold, on the selection episodes.
    selected: float = np.nan
    # Run folder of an agent that was trained.
    folder: Path | None = None
    # Whether it is an agent, see `is_learned`.
    learned: bool = False

    @property
    def name(self) -> str:
        """Name in tables and pictures."""
        return self.scores.name

    @property
    def threshold(self) -> float:
        """The selected threshold."""
        return self.scores.thresholds[self.chosen]

    @property
    def threshold_words(self) -> str:
        """The selected threshold below its symbol, for tables; "-" without one."""
        has_one = self.scores.symbol and self.threshold < NO_EARLY_DECISION
        return f"{self.scores.symbol}\n{self.threshold:g}" if has_one else "-"

    @cached_property
    def estimates(self) -> dict[str, Estimate]:
        """All metrics of the task at the selected threshold, by name."""
        return self.task.estimates(self.scores, self.chosen)

    def less(self, other: "Result") -> Estimate | None:
        """Return the paired difference of the reward to that of another; None to itself."""
        if self is other:
            return None
        reward = self.task.statistic("reward")
        return self.scores.difference(other.scores, reward, self.chosen, other.chosen)

    def as_json(self) -> dict[str, Any]:
        """Return the values for `write_json`."""
        extra = {name: finite(values[self.chosen]) for name, values in self.scores.extra.items()}
        threshold = {"symbol": self.scores.symbol, "value": self.threshold}
        return {"name": self.name, "threshold": threshold, **self.estimates, **extra}


def scores_table(
    results: Sequence[Result],
    best: Result,
    title: str,
    notes: str = "",
    bound: Mapping[str, Estimate] | None = None,
) -> Table:
    """Return a table of the metrics of deciders, and of the paired differences to `best`.

    The notes stand before the explanation of the metrics, each line with its end. `bound` has the
    reward of the bound and its paired difference, see `bound.bound_scores`.
    """
    task = best.task
    reward = next(metric for metric in task.metrics if metric.name == "reward")
    compared = len(results) > 1
    quantiles = "delay_quantiles" in best.scores.extra
    has_bank = any(result.scores.bank for result in results)
    heads = ["decider", "threshold", *["bank\nread"] * has_bank]
    heads += [metric.head for metric in task.shown]
    heads += ["delay\n50,90%"] * quantiles + ["reward\ndiff."] * compared
    if compared:
        notes += f"diff.: reward less that of {best.name} on the same episodes.\n"
    notes += "± half width of the 95 % confidence interval.\n"
    rows = []
    for result in results:
        cells = [result.threshold_words]
        cells += [result.scores.bank.replace("_", "-\n")] * has_bank
        cells += [
            estimate_cell(result.estimates[metric.name], metric.scale, metric.digits)
            for metric in task.shown
        ]
        if quantiles:
            ticks = result.scores.extra["delay_quantiles"][result.chosen]
            cells.append("\n".join(f"{tick:.0f}" for tick in ticks).replace("nan", "-"))
        if compared:
            difference = result.less(best)
            cells.append(
                ""
                if difference is None
                else estimate_cell(difference, 1.0, reward.digits, sign="+")
            )
        rows.append((escape(result.name), *cells))
    if bound:
        shown = {
            reward.head: estimate_cell(bound["reward"], reward.scale, reward.digits),
            "reward\ndiff.": estimate_cell(bound["less"], 1.0, reward.digits, sign="+"),
        }
        rows.append(("bound", *(shown.get(head, "") for head in heads[1:])))
        notes += (
            "bound: no rule earns more on average, as far as the model of the filters is right.\n"
        )
    return filled_table(title, heads, rows, f"{notes}{task.notes}".strip())


def metrics_table(
    title: str,
    metrics: Sequence[Metric],
    rows: Mapping[str, Mapping[str, Estimate]],
    notes: str = "",
) -> Table:
    """Return a table of some metrics, from their values by the names of deciders and metrics."""
    lines = [
        [
            escape(name),
            *(
                estimate_cell(values[metric.name], metric.scale, metric.digits)
                if metric.name in values
                else ""
                for metric in metrics
            ),
        ]
        for name, values in rows.items()
    ]
    return filled_table(title, ("decider", *(metric.head for metric in metrics)), lines, notes)


def result_tables(results: Sequence[Result], confusion: bool = False) -> list[Table]:
    """Return tables of deciders at one threshold each; those of one environment are compared with
    the first of them. With `confusion` each has its confusion matrix too.
    """
    tables = []
    for task in dict.fromkeys(str(result.task) for result in results):
        same = [result for result in results if str(result.task) == task]
        first = same[0]
        title = f"{first.task.title}: {first.task.size(first.scores.episodes)}"
        tables.append(scores_table(same, first, title))
        if confusion:
            tables += [confusion_table(each) for each in same if "confusion" in each.scores.extra]
    return tables


def confusion_table(result: Result) -> Table:
    """Return the confusion matrix of a decider."""
    options = result.task.options
    modes = [mode_name(mode, options.all_modes) for mode in range(options.hypotheses)]
    counts = result.scores.extra["confusion"][result.chosen]
    rows = [(mode, *map(str, row)) for mode, row in zip(modes, counts, strict=True)]
    title = f"{result.name}: true mode in rows, decided mode in columns"
    return filled_table(title, ("", *modes), rows)
