"""Announced switches: the mode of every segment is declared once."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.task import Levels, Metric, OnProgress, Recorded, Selected, Task
from agents.evaluation.worlds import shifted_worlds
from baselines.rules import seeds
from baselines.rules.decider import ANNOUNCED, Decider
from baselines.rules.msprt import mode_types, read_error_probability, rewarded
from baselines.rules.rollout import batch_size, check_episodes, evaluate_batch, rollout
from baselines.scoring.decisions import COLUMNS, ERROR_AFTER, RMSE
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import NOT_REACHED, Scores, Statistic, at_level, interpolated, mean
from hybrid_env.checks import BoolArray, FloatArray
from hybrid_env.options import WorldOptions
from hybrid_env.vector_env import HybridTrackVectorEnv


def calibration_rows(
    episodes: int,
    seed: int,
    options: Mapping[str, Any],
    ticks: tuple[int, ...] = (2, 5, 10, 20, 40),
) -> list[dict[str, Any]]:
    """Return the calibration of the bank's posterior after numbers of ticks without a decision.

    Of a row, "right" is the accuracy of the most probable hypothesis or type, "stated" its mean
    posterior, and "worst" the largest calibration error: posterior minus accuracy in a bin; None
    without a bin of enough segments. Segments are decided at their end, so that most anchors are
    accurate.
    """
    world = WorldOptions.of(**{**options, "undecided": "likeliest"})
    env = HybridTrackVectorEnv(episodes, tick_info=False, **vars(world))
    by = rewarded(world)
    kind = mode_types(world.hypotheses) if by == "type" else np.arange(world.hypotheses)
    segments = np.arange(episodes) * world.segments
    # By segment, so that sums do not depend on the order in which tracks reach a tick.
    shape = len(ticks), episodes * world.segments
    errors = np.full(shape, np.nan)
    right = np.zeros(shape, np.bool_)
    running = np.ones(episodes, np.bool_)
    for now in rollout(env, lambda rows: np.zeros(len(rows), np.int64), seed):
        running &= ~(now.terminated & (now.step > 0))
        if not running.any():
            break
        value, best = read_error_probability(now.observation, by)
        correct = kind[best] == kind[env.world.field("true_mode")]
        for k, tick in enumerate(ticks):
            reached = running & (env.world.field("tick") == tick)
            places = (segments + env.world.field("segment"))[reached]
            errors[k, places], right[k, places] = np.exp(value[reached]), correct[reached]
    results = zip(ticks, errors, right, strict=True)
    return [
        _calibration_row(tick, error[~np.isnan(error)], correct[~np.isnan(error)])
        for tick, error, correct in results
        if not np.isnan(error).all()
    ]


def _calibration_row(tick: int, error: FloatArray, correct: BoolArray) -> dict[str, Any]:
    """Return a row from stated error probabilities (n,) and whether they were right, (n,)."""
    stated = 1.0 - error
    edges = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
    bins = np.digitize(stated, edges)
    count = np.bincount(bins, minlength=len(edges) + 1)
    total = np.maximum(count, 1)
    mean_stated, accuracy = (
        np.bincount(bins, values, minlength=count.size) / total for values in (stated, correct)
    )
    # In smaller bins the accuracy has a standard error of up to 1.6 percentage points.
    gaps = (mean_stated - accuracy)[count >= 1000]
    return {
        "ticks": tick,
        "right": float(correct.mean()),
        "stated": float(1.0 - error.mean()),
        "worst": float(gaps[np.abs(gaps).argmax()]) if gaps.size else None,
    }


ACCURACY_LEVELS = (0.95, 0.98)


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
    further: ClassVar = tuple(
        Metric(f"error_after_{name}", f"after a {name}\ndecision, %", statistic, 1, 100.0)
        for name, statistic in ERROR_AFTER.items()
    )
    reference: ClassVar = "ate"
    paired: ClassVar = "against_reference"
    unit: ClassVar = "segment"
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
        self, decider: Decider, episodes: int, seed: int, on_progress: OnProgress
    ) -> list[Recorded]:
        options = {**self.given, **decider.options}
        decisions = evaluate_batch(decider, self.env_id, episodes, seed, on_progress, options)
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
        levels: Levels = {(name,): Metric(name, f"error, %\nat {ticks:.1f}", wrong, 2, 100.0)}
        for level in ACCURACY_LEVELS:
            time = at_level("accuracy", level, mean("ticks"))
            levels["ticks_at_accuracy", f"{level:g}"] = Metric(
                f"{level:g}",
                f"ticks at\n{level:.0%}",
                time,
                1,
            )
        return levels

    def against(self, mine: Selected, reference: Selected, curves: bool) -> dict[str, Estimate]:
        """Return the differences of the reward and of the decision time at 98 % accuracy."""
        scores, other = mine.scores, reference.scores
        time = at_level("accuracy", 0.98, mean("ticks"))
        differences = {
            "reward": scores.difference(other, mean("reward"), mine.chosen, reference.chosen)
        }
        if curves and max(scores.curve(time), other.curve(time)) < NOT_REACHED / 2:
            differences["ticks_at_98"] = scores.difference(other, time)
        return differences

    def remarks(self, episodes: int, seed: int) -> dict[str, Any]:
        """Return the number of segments and the calibration of the bank."""
        rows = calibration_rows(episodes, seed, vars(self.options))
        return {"segments": episodes * self.options.segments, "bank": rows}
