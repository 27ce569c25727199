"""Unknown switches: the present mode is stated at every tick."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import estimate_cell, filled_table
from agents.evaluation.curves import Groups, Selected, chosen, curves
from agents.evaluation.task import Levels, Metric, OnProgress, Recorded, Task, Wording
from agents.evaluation.worlds import RHYTHMS
from agents.figures.curves import Axis, Curve, Panel
from agents.figures.decider_colours import decider_styles
from agents.figures.tracks import TrackRecord
from baselines.rules.decider import UNKNOWN, rules
from baselines.rules.msprt import mode_types
from baselines.rules.rollout import record_together
from baselines.scoring import statements as scoring
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores, at_level, mean
from baselines.scoring.statements import (
    STATISTICS,
    StatementMetrics,
    Statements,
    measure_statements,
)
from hybrid_env.checks import check_integer
from hybrid_env.rendering.evidence import mode_name
from hybrid_env.rendering.history import History

# Statements with 3 modes, which need about 500 MB with 20 thresholds.
LARGEST_BATCH = 1_000_000
# Statements of one threshold.
LARGEST_RESULT = 100_000_000
# Expected number on all tracks; every threshold stores their delays.
MOST_SEGMENTS = 2_000_000
# Ticks after a switch, of the curves of identification.
LONGEST_DELAY = 100
# Of the delays of detected switches.
QUANTILES = (0.5, 0.9)
RATES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
# Wrong changes per 1,000 ticks at which delays are compared.
EQUAL_WRONG_CHANGES = 2.0
EQUAL = {
    name: at_level("wrong_changes", EQUAL_WRONG_CHANGES, STATISTICS[name], falling=True)
    for name in ("full_delay", "delay", "missed")
}
"""Figures at that rate; those at the first threshold if that already has fewer wrong changes."""

NOTES = """delay: ticks from a switch to the first right statement; 50 and 90 % quantiles.
missed: switches followed by another one before the new mode was stated.
delay, all: a switch that is not detected counts until the end of its segment.
wrong: changes of the statement to a wrong mode per 1,000 ticks.
changes: of the statement, per switch."""


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
    notes: ClassVar = NOTES
    paired: ClassVar = "ratio"
    reference: ClassVar = "threshold"
    wording: ClassVar = Wording(
        "threshold",
        "IMM threshold",
        "threshold rule",
        "tick",
        ("right", "wrong_changes"),
        "right {right:.1%} of the time, {wrong_changes:.1f} wrong changes in 1,000 ticks",
    )
    figure_note: ClassVar = (
        "Filled markers: thresholds selected on other tracks. "
        "A switch that is not detected counts until the end of its segment."
    )
    episodes: ClassVar = 500
    selection_episodes: ClassVar = 300

    def size(self, episodes: int) -> str:
        return f"{episodes:,} tracks of {self.options.ticks:,} ticks"

    def shifted(self) -> dict[str, dict[str, Any]]:
        """Return habits of the object; see `Task.shifted`."""
        # As one of their orders.
        three = self.options.hypotheses == 3
        return {name: one for name, one in RHYTHMS.items() if three or "order" not in one}

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
        largest = max(1, int(min(LARGEST_RESULT / options.ticks, MOST_SEGMENTS / segments)))
        check_integer(name, episodes, maximum=largest)

    def batch(self) -> int:
        return max(1, 3 * LARGEST_BATCH // (self.options.ticks * self.options.hypotheses))

    def record(
        self,
        deciders: Sequence[Any],
        changes: Mapping[str, Any],
        episodes: int,
        seed: int,
        on_progress: OnProgress,
    ) -> list[Recorded]:
        found = record_together(deciders, episodes, seed, **vars(self.options_with(changes)))
        return [self.measured(statements) for statements in found]

    def measured(self, statements: Statements) -> Recorded:
        """Return the figures of recorded statements."""
        metrics = of_types = measure_statements(statements, self.options.change_cost)
        if self._several_radii:
            types = Statements(
                *(mode_types(self.options.hypotheses)[modes] for modes in statements)
            )
            of_types = measure_statements(types, self.options.change_cost)
        longest = min(LONGEST_DELAY, int(self.options.ticks))
        within = np.array([[one.named_within(longest) for one in (of_types, metrics)]])
        figures = np.hstack([metrics.figures, of_types.figures])
        return Recorded(figures, {"delays": metrics.delays, "named_within": within})

    @property
    def _several_radii(self) -> bool:
        return len(self.options.radii) > 1

    def extra(self, samples: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return quantiles of detected delays [ticks], and shares of types and modes named in
        time (2, ticks + 1).
        """
        delays = samples["delays"]
        counts = samples["named_within"].sum(0)
        quantiles = (
            np.quantile(delays, QUANTILES) if delays.size else np.full(len(QUANTILES), np.nan)
        )
        return {
            "delay_quantiles": quantiles,
            "named_within": counts[:, :-1] / np.maximum(counts[:, -1:], 1),
        }

    def levels(self, reference: Scores, default: float) -> Levels:
        """Return delays and misses at an equal rate of wrong changes."""
        heads = {
            "full_delay": "delay,\nall",
            "delay": "delay\nof detected",
            "missed": "missed\n%",
        }
        return {
            ("at_equal_wrong_changes", name): Metric(
                name,
                head,
                EQUAL[name],
                1,
                100.0 if name == "missed" else 1.0,
            )
            for name, head in heads.items()
        }

    def against(
        self,
        mine: Selected,
        reference: Selected,
        curves: bool,
    ) -> dict[str, dict[str, Estimate]]:
        """Return the ratios of both mean delays at an equal rate of wrong changes."""
        if not curves:
            return {}
        ratios = {
            name: mine.scores.ratio(reference.scores, EQUAL[name])
            for name in ("full_delay", "delay")
        }
        return {"ratio_to_reference": ratios}

    def further_tables(self, scores: Sequence[Scores], remarks: Mapping[str, Any]) -> list[Table]:
        """Return how often and when type and mode are named after a switch, with several radii."""
        if not self._several_radii:
            return []
        heads = ("decider", "type\nnamed, %", "delay to\ntype", "mode\nnamed, %", "delay to\nmode")
        rows = []
        for one in scores:
            cells = [
                estimate_cell(one.estimate(statistic), 100.0 if name == "identified" else 1.0, 1)
                for found in scoring.IDENTIFICATION.values()
                for name, statistic in found.items()
            ]
            rows.append((escape(one.name), *cells))
        notes = (
            "type: straight, left or right; mode: with the radius. named: stated before the next"
            " switch."
        )
        return [filled_table("Type and radius after a switch", heads, rows, notes)]

    @property
    def figure_title(self) -> str:
        return f"{super().figure_title}, segments of {self.options.law} ticks"

    def panels(self, groups: Groups) -> list[Panel]:
        """Return mean delay and mean reward against wrong changes per 1,000 ticks.

        Switches that are not detected count in the delay: a strict threshold, which detects only
        the easiest ones, would else seem quick. A dashed line marks the rate at which delays are
        compared.
        """
        wrong = mean("wrong_changes")
        rates = [EQUAL_WRONG_CHANGES, *(rate for rate in chosen(groups, wrong) if rate > 0.0)]
        low = min(rates) / 3.0
        high = max(rates) * 3.0
        ticks = {rate: f"{rate:g}" for rate in RATES if low <= rate <= high}
        axis = Axis(
            "wrong changes per 1,000 ticks",
            (low, high),
            ticks,
            log=True,
            levels=(EQUAL_WRONG_CHANGES,),
        )
        reward = f"Mean reward, a wrong change costs {self.options.change_cost:g} ticks"
        found = []
        every = [one.scores for group in groups.values() for one in group]
        x = np.concatenate([scores.curve(wrong) for scores in every])
        inside = (x >= min(rates) / 1.7) & (x <= high)
        for title, label, name in (
            ("Delay against wrong changes", "mean delay of a switch, ticks", "full_delay"),
            (reward, "mean reward of a tick", "reward"),
        ):
            shown = np.concatenate([scores.curve(STATISTICS[name]) for scores in every])[
                inside
            ].tolist()
            margin = 0.06 * (max(shown) - min(shown))
            limits = min(shown) - margin, max(shown) + margin
            lines = curves(groups, wrong, STATISTICS[name], (0.0, -np.inf))
            found.append(Panel(title, axis, Axis(label, limits), lines))
        if self._several_radii:
            styles = decider_styles(groups)
            for k, title in enumerate(("Straight, left or right named", "Type and radius named")):
                lines = []
                for name, group in groups.items():
                    shares = np.mean(
                        [one.scores.extra["named_within"][one.chosen, k] for one in group],
                        axis=0,
                    )
                    lines.append(
                        Curve(name, styles[name], np.arange(shares.size), 100.0 * shares, size=0.0)
                    )
                times = Axis("ticks after a switch", (0.0, float(shares.size)))
                found.append(Panel(title, times, Axis("switches, %", (0.0, 100.0)), lines))
        return found

    def episode_table(self, title: str, history: History) -> Table:
        """Return one row for each segment, and metrics of the episode."""
        true, stated, rows = history.true_modes, history.stated, []
        right = true == stated
        wrong = (np.diff(stated, prepend=stated[:1]) != 0) & ~right
        bounds = [*history.switches.tolist(), len(true)]
        for number, (first, end) in enumerate(pairwise(bounds), start=1):
            inside = right[first:end]
            mode = mode_name(int(true[first]), self.options.radii)
            until = str(inside.argmax()) if inside.any() else "[red]never[/]"
            changes = str(wrong[first:end].sum())
            rows.append(
                (str(number), mode, str(end - first), until, f"{inside.mean():.0%}", changes)
            )
        metrics = self._of_episode(history)
        caption = f"right {metrics.right[0]:.1%}, reward {metrics.reward[0]:.3f} per tick"
        heads = ("segment", "true mode", "ticks", "ticks until stated", "right", "wrong changes")
        return filled_table(title, heads, rows, caption, 2)

    def track_record(self, history: History, **common: Any) -> TrackRecord:
        """Return the statements."""
        stated, metrics = history.stated, self._of_episode(history)
        delay = metrics.value("delay")
        delayed = "no switch detected" if np.isnan(delay) else f"mean delay {delay:.1f} ticks"
        wrong = round(1e-3 * len(stated) * float(metrics.wrong_changes[0]))
        right, reward = (
            f"{100 * metrics.right[0]:.1f} % of the ticks right",
            f"mean reward {metrics.reward[0]:.3f}",
        )
        summary = f"{right}, {delayed}, {wrong} changes to a wrong mode, {reward}"
        return TrackRecord(
            **common,
            modes=stated,
            right=history.true_modes == stated,
            switches=np.zeros(0, np.int64),
            marks=np.flatnonzero(np.diff(stated, prepend=stated[:1])),
            summary=summary,
        )

    def _of_episode(self, history: History) -> StatementMetrics:
        statements = Statements(history.true_modes[:, None], history.stated[:, None])
        return measure_statements(statements, self.options.change_cost)
