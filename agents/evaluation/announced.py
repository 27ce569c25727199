"""Announced switches: the mode of every segment is declared once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import filled_table
from agents.evaluation.curves import Groups, Selected, chosen, curves
from agents.evaluation.task import Levels, Metric, OnProgress, Recorded, Task, Wording
from agents.evaluation.worlds import shifted_worlds
from agents.figures.curves import Axis, Panel
from agents.figures.tracks import UNDECIDED, TrackRecord
from baselines.rules import seeds
from baselines.rules.decider import ANNOUNCED
from baselines.rules.posterior_paths import MIN_COUNT, calibration, simulate_posterior_paths
from baselines.rules.rollout import batch_size, check_episodes, evaluate_batch
from baselines.scoring.decisions import COLUMNS, ERROR_AFTER, RMSE
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import NOT_REACHED, Scores, Statistic, at_level, interpolated, mean
from hybrid_env.rendering.evidence import mode_name
from hybrid_env.rendering.history import History

CALIBRATION_TICKS = (2, 5, 10, 20, 40)


def calibration_rows(episodes: int, seed: int, options: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the calibration of the bank's posterior after numbers of ticks without a decision.

    Of a row, "right" is the accuracy of the most probable hypothesis or type, "stated" its mean
    posterior, and "worst" the largest calibration error: posterior minus accuracy in a bin; None
    without a bin of enough segments.
    """
    paths = simulate_posterior_paths(episodes, seed, max(CALIBRATION_TICKS), **options)
    rows = []
    for tick in CALIBRATION_TICKS:
        if (paths.length >= tick).any():
            one = calibration(paths, tick)
            worst = one.worst if np.isfinite(one.worst) else None
            rows.append(
                {
                    "ticks": tick,
                    "right": one.mean_accuracy,
                    "stated": one.mean_stated,
                    "worst": worst,
                }
            )
    return rows


def calibration_table(rows: Sequence[Mapping[str, Any]], bank: str) -> Table:
    """Return a table of `calibration_rows` of a bank."""
    cells = []
    for row in rows:
        worst = "-" if row["worst"] is None else f"{100 * row['worst']:+.1f}"
        cells.append(
            (f"{row['ticks']:g}", f"{100 * row['right']:.1f}", f"{100 * row['stated']:.1f}", worst)
        )
    return filled_table(
        f"Calibration of the {bank.replace('_', '-')} bank (no decisions)",
        ("ticks", "accuracy\n%", "mean\nposterior, %", "largest calibration\nerror, %"),
        cells,
        f"Calibration error: mean posterior minus accuracy,\nin bins of at least {MIN_COUNT:,}"
        " segments.",
        0,
    )


ERRORS = (0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
ACCURACY_LEVELS = (0.95, 0.98)
ERROR = Statistic(("accuracy",), lambda accuracy: 1.0 - accuracy, share=True)


@dataclass(frozen=True)
class AnnouncedTask(Task):
    """Every switch is announced, and the mode of the segment is declared once."""

    switches: ClassVar = ANNOUNCED
    waits: ClassVar = True
    columns: ClassVar = COLUMNS
    metrics: ClassVar = (
        Metric("accuracy", "accuracy\n%", mean("accuracy", share=True), 1, 100.0),
        Metric("type_accuracy", "type\naccuracy, %", mean("type_accuracy", share=True), 1, 100.0),
        Metric("ticks", "mean\nticks", mean("ticks"), 1),
        Metric("reward", "mean\nreward", mean("reward"), 3),
        Metric("forced", "undecided\n%", mean("forced", share=True), 1, 100.0),
        Metric("rmse", "RMSE\nm", RMSE, 3),
    )
    further: ClassVar = {
        f"error_after_{name}": statistic for name, statistic in ERROR_AFTER.items()
    }
    paired: ClassVar = "diff."
    reference: ClassVar = "ate"
    wording: ClassVar = Wording(
        "sprt",
        "ATE (SPRT)",
        "SPRT",
        "segment",
        ("accuracy", "ticks"),
        "accuracy {accuracy:.1%}, mean decision time {ticks:.1f} ticks",
    )
    episodes: ClassVar = 1500
    selection_episodes: ClassVar = seeds.SELECTION_EPISODES

    def size(self, episodes: int) -> str:
        return f"{episodes * self.options.segments:,} segments"

    def shifted(self) -> dict[str, dict[str, Any]]:
        return shifted_worlds(self.options)

    @property
    def compared(self) -> tuple[str, ...]:
        if self.options.bank == "published":
            return (self.reference, "fixed", "msprt", "msprt-kept", "calibrated")
        return (
            self.reference,
            "sprt",
            "msprt-type" if self.options.correctness == "type" else "msprt",
        )

    @property
    def agents(self) -> tuple[str, ...]:
        """See `Task.agents`."""
        return (
            ("ppo", "shipped-threshold", "shipped")
            if self.options.bank == "published"
            else ("ppo", "shipped")
        )

    def check_episodes(self, name: str, episodes: int) -> None:
        check_episodes(name, episodes, self.options)

    def batch(self) -> int:
        return batch_size(self.options)

    def record(
        self,
        deciders: Sequence[Any],
        changes: Mapping[str, Any],
        episodes: int,
        seed: int,
        on_progress: OnProgress,
    ) -> list[Recorded]:
        (decider,) = deciders
        decisions = evaluate_batch(
            decider,
            self.env_id,
            episodes,
            seed,
            on_progress,
            {**self.given, **changes},
        )
        modes = {
            "true_mode": decisions.true_mode.ravel(),
            "decided_mode": decisions.decided_mode.ravel(),
        }
        return [Recorded(decisions.figures, modes)]

    def extra(self, samples: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return the confusion matrix (M, M): true mode in rows, decided mode in columns."""
        counts = np.zeros((self.options.hypotheses,) * 2, np.int64)
        np.add.at(counts, (samples["true_mode"], samples["decided_mode"]), 1)
        return {"confusion": counts}

    def levels(self, reference: Scores, default: float) -> Levels:
        """Return the error rate at the mean time of the reference, and the mean times at two
        accuracies.
        """
        ticks = float(reference.curve(mean("ticks"))[reference.thresholds.index(default)])
        error = interpolated("ticks", ticks, "accuracy")
        wrong = Statistic(error.columns, lambda *means: 1.0 - error.function(*means), share=True)
        name = "equal_time_error"
        found: Levels = {(name,): Metric(name, f"error, %\nat {ticks:.1f}", wrong, 2, 100.0)}
        for level in ACCURACY_LEVELS:
            time = at_level("accuracy", level, mean("ticks"))
            found["ticks_at_accuracy", f"{level:g}"] = Metric(
                f"{level:g}",
                f"ticks at\n{level:.0%}",
                time,
                1,
            )
        return found

    def against(
        self,
        mine: Selected,
        reference: Selected,
        curves: bool,
    ) -> dict[str, dict[str, Estimate]]:
        """Return the differences of the reward and of the decision time at 98 % accuracy."""
        own = mine.scores
        other = reference.scores
        found = {"reward": own.difference(other, mean("reward"), mine.chosen, reference.chosen)}
        time = at_level("accuracy", 0.98, mean("ticks"))
        if curves and all(one.curve(time) < NOT_REACHED / 2 for one in (own, other)):
            found["ticks_at_98"] = own.difference(other, time)
        return {"against_reference": found}

    def remarks(self, episodes: int, seed: int) -> dict[str, Any]:
        """Return the number of segments and the calibration of the bank."""
        rows = calibration_rows(episodes, seed, vars(self.options))
        return {"segments": episodes * self.options.segments, "bank": rows}

    def further_tables(self, scores: Sequence[Scores], remarks: Mapping[str, Any]) -> list[Table]:
        """Return errors by previous decision, as a wrong one makes the next anchor inaccurate,
        and the calibration.
        """
        heads = ("decider", "after a correct\ndecision, %", "after a wrong\ndecision, %")
        rows = []
        for one in scores:
            shares = [float(one.curve(statistic)[0]) for statistic in ERROR_AFTER.values()]
            rows.append(
                (
                    escape(one.name),
                    *(f"{100 * share:.1f}" if np.isfinite(share) else "-" for share in shares),
                )
            )
        errors = filled_table("Error rate by previous decision", heads, rows)
        return [errors, calibration_table(remarks["bank"], self.options.bank)]

    def panels(self, groups: Groups) -> list[Panel]:
        """Return accuracy and mean reward against mean decision time.

        The accuracy axis is logarithmic in the error rate, so that 98 % and 99 % are
        distinguishable. No error among n segments is drawn as half an error.
        """
        first = next(iter(groups.values()))[0].scores
        least = 0.5 / (first.episodes * self.options.segments)
        times, wrong, rewards = (
            list(chosen(groups, one)) for one in (mean("ticks"), ERROR, mean("reward"))
        )
        best = max(rewards)
        worst = min(rewards)
        ticks = Axis(
            "mean decision time, ticks",
            (0.0, max([30.0, *(1.8 * time for time in times)])),
        )
        error = Axis(
            "accuracy, % of segments",
            (max(0.6, 1.1 * max(wrong)), min(0.8e-3, 0.8 * max(min(wrong), least))),
            {error: f"{100 * (1 - error):g}" for error in ERRORS},
            log=True,
            levels=tuple(1.0 - level for level in ACCURACY_LEVELS),
        )
        reward = Axis(
            "mean reward per segment",
            (min(-0.4 * abs(best), best - 0.5, worst - 0.08), best + 0.08),
        )
        found = curves(groups, mean("ticks"), ERROR, (-np.inf, least))
        accuracy = "Accuracy against mean decision time"
        cost = f"Mean reward per segment, delay cost {self.options.delay_cost:g} per tick"
        return [
            Panel(accuracy, ticks, error, found),
            Panel(
                cost,
                ticks,
                reward,
                curves(groups, mean("ticks"), mean("reward"), (-np.inf, -np.inf)),
            ),
        ]

    def episode_table(self, title: str, history: History) -> Table:
        """Return one row for each decision."""
        rows = []
        for number, decision in enumerate(history.decisions, start=1):
            modes = (
                mode_name(mode, self.options.radii) for mode in (decision.true_mode, decision.mode)
            )
            verdict = "[green]correct[/]" if decision.correct else "[red]wrong[/]"
            verdict += ", forced" if decision.forced else ""
            rows.append((str(number), *modes, verdict, f"{decision.ticks} of {decision.length}"))
        return filled_table(
            title,
            ("segment", "true mode", "decided mode", "decision", "ticks"),
            rows,
            texts=4,
        )

    def track_record(self, history: History, **common: Any) -> TrackRecord:
        """Return the declarations: statements from their tick to the end of the segment."""
        decisions, stated = history.decisions, history.stated
        lengths, ticks, correct = (
            np.array([getattr(one, key) for one in decisions])
            for key in ("length", "ticks", "correct")
        )
        switches = np.cumsum(lengths) - lengths
        since = np.arange(len(stated)) - np.repeat(switches, lengths)
        rewards = np.where(correct, 1.0, -1.0) - self.options.delay_cost * ticks
        return TrackRecord(
            **common,
            modes=np.where(since < np.repeat(ticks, lengths), UNDECIDED, stated),
            switches=switches,
            right=np.repeat(correct, lengths),
            marks=switches + ticks - 1,
            summary=f"{rewards.mean():+.2f}",
        )
