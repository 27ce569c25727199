"""Unknown switches: the present mode is stated at every tick."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.task import Levels, Metric, OnProgress, Recorded, Selected, Task
from agents.evaluation.worlds import RHYTHMS
from baselines.rules.decider import UNKNOWN, Decider, rules
from baselines.rules.msprt import mode_types
from baselines.rules.rollout import record_in, statement_env
from baselines.scoring import statements as scoring
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores, at_level
from baselines.scoring.statements import (
    STATISTICS,
    Statements,
    measure_statements,
)
from hybrid_env.checks import check_integer

# Wrong changes per 1,000 ticks at which delays are compared.
EQUAL_WRONG_CHANGES = 2.0
EQUAL = {
    name: at_level("wrong_changes", EQUAL_WRONG_CHANGES, STATISTICS[name], falling=True)
    for name in ("full_delay", "delay", "missed")
}
"""Figures at that rate; those at the first threshold if that already has fewer wrong changes."""


@dataclass(frozen=True)
class UnknownTask(Task):
    """Nobody announces switches, and the present mode is stated at every tick."""

    switches: ClassVar = UNKNOWN
    columns: ClassVar = scoring.COLUMNS + scoring.TYPE_COLUMNS
    metrics: ClassVar = (
        Metric("reward", "reward", STATISTICS["reward"], 4),
        Metric("right", "right\n%", STATISTICS["right"], 1, 100.0),
        Metric("delay", "delay\nmean", STATISTICS["delay"], 1),
        Metric("missed", "missed\n%", STATISTICS["missed"], 1, 100.0),
        Metric("full_delay", "delay,\nall", STATISTICS["full_delay"], 1),
        Metric("wrong_changes", "wrong\n/1000", STATISTICS["wrong_changes"], 2),
        Metric("change_ratio", "changes", STATISTICS["change_ratio"], 2),
    )
    notes: ClassVar = (
        "delay: ticks from a switch to the first right statement; 50 and 90 % quantiles.\n"
        "missed: switches followed by another one before the new mode was stated.\n"
        "delay, all: a switch that is not detected counts until the end of its segment.\n"
        "wrong: changes of the statement to a wrong mode per 1,000 ticks.\n"
        "changes: of the statement, per switch."
    )
    reference: ClassVar = "threshold"
    paired: ClassVar = "ratio_to_reference"
    unit: ClassVar = "tick"
    episodes: ClassVar = 500
    selection_episodes: ClassVar = 300

    def size(self, episodes: int) -> str:
        return f"{episodes:,} tracks of {self.options.ticks:,} ticks"

    def shifted(self) -> dict[str, dict[str, Any]]:
        """Return habits of the object; see `Task.shifted`."""
        # As one of their orders.
        three = self.options.hypotheses == 3
        return {name: habits for name, habits in RHYTHMS.items() if three or "order" not in habits}

    @property
    def agents(self) -> tuple[str, ...]:
        """See `Task.agents`."""
        return ("shipped",)

    @property
    def compared(self) -> tuple[str, ...]:
        """All rules; see `Task.compared`."""
        return tuple(dict.fromkeys((self.reference, *rules(UNKNOWN))))

    def check_episodes(self, name: str, episodes: int) -> None:
        options = self.options
        segments = options.ticks / min(options.law.mean_duration, options.ticks)
        # Statements of one threshold, and expected segments, whose delays every threshold stores.
        largest = max(1, int(min(1e8 / options.ticks, 2e6 / segments)))
        check_integer(name, episodes, maximum=largest)

    def batch(self) -> int:
        # A million statements with 3 modes need about 500 MB with 20 thresholds.
        return max(1, 3_000_000 // (self.options.ticks * self.options.hypotheses))

    def record(
        self, decider: Decider, episodes: int, seed: int, on_progress: OnProgress
    ) -> list[Recorded]:
        options: Any = self.options_with(decider.options)
        make = functools.partial(statement_env, options, episodes)
        return [self.measured(statements) for statements in record_in(make, decider, seed)]

    def measured(self, statements: Statements) -> Recorded:
        """Return the figures of recorded statements."""
        metrics = of_types = measure_statements(statements, self.options.change_cost)
        if self.several_radii:
            types = Statements(
                *(mode_types(self.options.hypotheses)[modes] for modes in statements)
            )
            of_types = measure_statements(types, self.options.change_cost)
        # Ticks after a switch, of the curves of identification.
        longest = min(100, int(self.options.ticks))
        within = np.array([[each.named_within(longest) for each in (of_types, metrics)]])
        figures = np.hstack([metrics.figures, of_types.figures])
        return Recorded(figures, {"delays": metrics.delays, "named_within": within})

    @property
    def several_radii(self) -> bool:
        """Whether a type of motion has several modes."""
        return len(self.options.radii) > 1

    def extra(self, samples: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return quantiles of detected delays [ticks], and shares of types and modes named in
        time (2, ticks + 1).
        """
        delays = samples["delays"]
        counts = samples["named_within"].sum(0)
        quantiles = np.quantile(delays, (0.5, 0.9)) if delays.size else np.full(2, np.nan)
        return {
            "delay_quantiles": quantiles,
            "named_within": counts[:, :-1] / np.maximum(counts[:, -1:], 1),
        }

    def levels(self, reference: Scores, default: float) -> Levels:
        """Return delays and misses at an equal rate of wrong changes."""
        metrics = (
            Metric("full_delay", "delay,\nall", EQUAL["full_delay"], 1),
            Metric("delay", "delay\nof detected", EQUAL["delay"], 1),
            Metric("missed", "missed\n%", EQUAL["missed"], 1, 100.0),
        )
        return {("at_equal_wrong_changes", metric.name): metric for metric in metrics}

    def against(self, mine: Selected, reference: Selected, curves: bool) -> dict[str, Estimate]:
        """Return the ratios of both mean delays at an equal rate of wrong changes."""
        names = ("full_delay", "delay") if curves else ()
        return {name: mine.scores.ratio(reference.scores, EQUAL[name]) for name in names}

    @property
    def further(self) -> tuple[Metric, ...]:  # type: ignore[override]
        """How often and when type and mode are stated after a switch, with several radii."""
        if not self.several_radii:
            return ()
        heads = {"identified": ("named, %", 100.0), "delay": ("delay", 1.0)}
        return tuple(
            Metric(f"{kind}_{name}", f"{kind}\n{head}", statistics[name], 1, scale)
            for kind, statistics in scoring.IDENTIFICATION.items()
            for name, (head, scale) in heads.items()
        )
