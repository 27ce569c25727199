"""Announced switches: the mode of every segment is declared once; decisions, rewards and their metrics."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table

from agents.evaluation.calibration import calibration_rows, calibration_table
from agents.evaluation.cells import new_table
from agents.evaluation.shifted_worlds import shifted_worlds
from agents.evaluation.task import Levels, Metric, Recorded, Task
from baselines.rules import seeds
from baselines.rules.decider import ANNOUNCED
from baselines.rules.rollout import rollout
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import (
    NOT_REACHED,
    Scores,
    Statistic,
    at_level,
    interpolated,
    mean,
    quotient,
    ratio,
)
from hybrid_env.checks import check_integer, reject
from hybrid_env.registration import make_vector_env

FloatArray = NDArray[np.float64]
LARGEST_BATCH = 700_000_000  # bytes
LARGEST_RESULT = 10_000_000  # segments, which need half a gigabyte

ACCURACY_LEVELS = (0.95, 0.98)
DECIDED = {
    "correct": np.bool_, "type_correct": np.bool_, "ticks": np.int64, "forced": np.bool_,
    "decided_true_mode": np.int64, "decided_mode": np.int64, "decided_length": np.int64,
    "decided_squared_error": np.float64,
}  # fmt: skip
"""What `info` tells of a decision."""

RMSE = Statistic(("squared_error", "length"), lambda error, length: np.sqrt(quotient(error, length)))
ERROR_AFTER = {
    "correct": ratio("wrong_after_correct", "after_correct"),
    "wrong": ratio("wrong_after_wrong", "after_wrong"),
}
"""Error rates after a correct and after a wrong decision in the episode."""


@dataclass(frozen=True)
class Decisions:
    """All decisions in E episodes with K segments each, as arrays of shape (E, K).

    Attributes:
        correct: the decision is correct as defined by the reward, exactly or by type.
        type_correct: the type (straight, left or right) is correct.
        ticks: decision time within the segment, in ticks.
        forced: the segment ended without a declaration.
        true_mode, decided_mode: indices into the bank.
        length: of the segment, in ticks.
        squared_error: of the estimated position, summed over the segment [m^2].
        delay_cost: per tick.
    """

    correct: NDArray[np.bool_]
    type_correct: NDArray[np.bool_]
    ticks: NDArray[np.int64]
    forced: NDArray[np.bool_]
    true_mode: NDArray[np.int64]
    decided_mode: NDArray[np.int64]
    length: NDArray[np.int64]
    squared_error: FloatArray
    delay_cost: float

    @cached_property
    def reward(self) -> FloatArray:
        """Reward of each segment, (E, K)."""
        return np.where(self.correct, 1.0, -1.0) - self.delay_cost * self.ticks

    @property
    def figures(self) -> FloatArray:
        """Figures of each episode, (E, 11), see `COLUMNS`."""
        previous, wrong = self.correct[:, :-1], ~self.correct[:, 1:]
        shares = [
            one.mean(1) for one in (self.correct, self.type_correct, self.ticks, self.reward, self.forced)
        ]
        sums = [self.squared_error.sum(1), self.length.sum(1)]
        after = [(wrong & previous).sum(1), previous.sum(1), (wrong & ~previous).sum(1), (~previous).sum(1)]
        return np.stack([*shares, *sums, *after], axis=1)


COLUMNS = (
    "accuracy", "type_accuracy", "ticks", "reward", "forced", "squared_error", "length",
    "wrong_after_correct", "after_correct", "wrong_after_wrong", "after_wrong",
)  # fmt: skip
"""Figures of an episode: means over its segments, then sums."""


def evaluate(
    decider: Any,
    env_id: str = "hybrid_env:HybridTrack-v0",
    episodes: int = 1000,
    seed: int = 0,
    on_progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Decisions:
    """Run a decider on the episodes with seeds seed, seed + 1, ..., each exactly once.

    All deciders face the same episodes: trajectories and noise do not depend on the decisions.

    Args:
        decider: see `baselines.rules.decider.Decider`.
        env_id: registered id.
        episodes: E; they run in parallel, one per track, in batches that need less than a gigabyte.
        seed: of the first episode.
        on_progress: called repeatedly with the fraction of finished segments.
        options: environment options that override those of the id.

    Raises:
        ArgumentError: the actions of the environment are not declarations of hypotheses.
    """
    task = AnnouncedTask(env_id, options)
    task.check_episodes("episodes", episodes)
    size, batches = task.batch(), []
    for first in range(0, episodes, size):
        count = min(size, episodes - first)

        def show(share: float, finished: int = first, width: int = count) -> None:
            if on_progress is not None:
                on_progress((finished + width * share) / episodes)

        batches.append(_evaluate_batch(decider, env_id, count, seed + first, show, options))
    arrays = {
        field.name: np.concatenate([getattr(batch, field.name) for batch in batches])
        for field in dataclasses.fields(Decisions)
        if field.name != "delay_cost"
    }
    return Decisions(**arrays, delay_cost=task.options.delay_cost)


def _evaluate_batch(
    decider: Any,
    env_id: str,
    episodes: int,
    seed: int,
    on_progress: Callable[[float], None],
    options: dict[str, Any],
) -> Decisions:
    env = make_vector_env(env_id, episodes, tick_info=False, **options)
    if env.options.actions != "all":
        raise reject("actions", env.options.actions, "'all': deciders declare hypotheses")
    segments = env.options.segments
    recorded: dict[str, NDArray[Any]] = {
        name: np.zeros((episodes, segments), kind) for name, kind in DECIDED.items()
    }
    finished = np.zeros(episodes, np.int64)  # recorded decisions of each track
    unfinished = np.ones(episodes, np.bool_)
    for now in rollout(env, decider, seed, unfinished):
        decided = now.info.get("_decided_mode") if now.step else None
        if decided is None:
            continue
        new = np.flatnonzero(decided & unfinished)
        for name, array in recorded.items():
            array[new, finished[new]] = now.info[name][new]
        finished[new] += 1
        unfinished[:] = finished < segments
        on_progress(float(finished.sum()) / recorded["ticks"].size)
        if not unfinished.any():
            break
    names = [name.removeprefix("decided_") if name != "decided_mode" else name for name in recorded]
    return Decisions(**dict(zip(names, recorded.values(), strict=True)), delay_cost=env.options.delay_cost)


@dataclass(frozen=True)
class AnnouncedTask(Task):
    """Every switch is announced, and the mode of the segment is declared once."""

    switches: ClassVar = ANNOUNCED
    columns: ClassVar = COLUMNS
    metrics: ClassVar = (
        Metric("accuracy", "accuracy\n%", mean("accuracy", share=True), 1, 100.0),
        Metric("type_accuracy", "type\naccuracy, %", mean("type_accuracy", share=True), 1, 100.0),
        Metric("ticks", "mean\nticks", mean("ticks"), 1, larger_is_better=False),
        Metric("reward", "mean\nreward", mean("reward"), 3),
        Metric("forced", "undecided\n%", mean("forced", share=True), 1, 100.0, larger_is_better=False),
        Metric("rmse", "RMSE\nm", RMSE, 3, larger_is_better=False),
    )
    further: ClassVar = {f"error_after_{name}": statistic for name, statistic in ERROR_AFTER.items()}
    paired: ClassVar = "diff."
    reference: ClassVar = "ate"
    agents: ClassVar = ("ppo", "shipped")
    episodes: ClassVar = 1500
    selection_episodes: ClassVar = seeds.SELECTION_EPISODES

    def size(self, episodes: int) -> str:
        """See `Task.size`."""
        return f"{episodes * self.options.segments:,} segments"

    def shifted(self) -> dict[str, dict[str, Any]]:
        """See `Task.shifted`."""
        return shifted_worlds(self.options)

    @property
    def compared(self) -> tuple[str, ...]:
        """See `Task.compared`."""
        return (self.reference, "fixed", "msprt", "msprt-kept", "calibrated")

    def check_episodes(self, name: str, episodes: int) -> None:
        """See `Task.check_episodes`."""
        check_integer(name, episodes, maximum=max(1, LARGEST_RESULT // self.options.segments))

    def batch(self) -> int:
        """See `Task.batch`."""
        bytes_per_episode = 2500 + 2800 * self.options.hypotheses  # measured, with a network
        return max(1, LARGEST_BATCH // bytes_per_episode)

    def record(
        self,
        deciders: Sequence[Any],
        changes: Mapping[str, Any],
        episodes: int,
        seed: int,
        on_progress: Callable[[float], None],
    ) -> list[Recorded]:
        """See `Task.record`."""
        (decider,) = deciders
        options = {**self.given, **changes}
        decisions = _evaluate_batch(decider, self.env_id, episodes, seed, on_progress, options)
        modes = {"true_mode": decisions.true_mode.ravel(), "decided_mode": decisions.decided_mode.ravel()}
        return [Recorded(decisions.figures, modes)]

    def extra(self, samples: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return the confusion matrix (M, M): true mode in rows, decided mode in columns."""
        counts = np.zeros((self.options.hypotheses,) * 2, np.int64)
        np.add.at(counts, (samples["true_mode"], samples["decided_mode"]), 1)
        return {"confusion": counts}

    def levels(self, reference: Scores, default: float) -> Levels:
        """Return the error rate at the mean time of the reference, and the mean times at two accuracies."""
        ticks = float(reference.curve(mean("ticks"))[reference.thresholds.index(default)])
        error = interpolated("ticks", ticks, "accuracy")
        wrong = Statistic(error.columns, lambda *means: 1.0 - error.function(*means), share=True)
        found: Levels = {
            ("equal_time_error",): Metric("equal_time_error", f"error, %\nat {ticks:.1f}", wrong, 2, 100.0)
        }
        for level in ACCURACY_LEVELS:
            time = at_level("accuracy", level, mean("ticks"))
            keys = "ticks_at_accuracy", f"{level:g}"
            found[keys] = Metric(keys[0], f"ticks at\n{level:.0%}", time, 1)
        return found

    def against(
        self, mine: Scores, chosen: int, reference: Scores, of_reference: int, curves: bool
    ) -> dict[str, dict[str, Estimate]]:
        """Return the differences of the reward and of the decision time at 98 % accuracy."""
        found = {"reward": mine.difference(reference, mean("reward"), chosen, of_reference)}
        time = at_level("accuracy", 0.98, mean("ticks"))
        if curves and all(one.curve(time) < NOT_REACHED / 2 for one in (mine, reference)):
            found["ticks_at_98"] = mine.difference(reference, time)
        return {"against_reference": found}

    def remarks(self, episodes: int, seed: int) -> dict[str, Any]:
        """Return the number of segments and the calibration of the bank."""
        rows = calibration_rows(episodes, seed, vars(self.options))
        return {"segments": episodes * self.options.segments, "bank": rows}

    def remark_tables(self, remarks: Mapping[str, Any]) -> list[Table]:
        """See `Task.remark_tables`."""
        return [calibration_table(remarks["bank"], self.options.bank)]

    def after_tables(self, scores: Sequence[Scores]) -> list[Table]:
        """Return error rates by previous decision: after a wrong one the next anchor is inaccurate."""
        table = new_table("Error rate by previous decision")
        table.add_column("decider")
        for head in ("after a correct\ndecision, %", "after a wrong\ndecision, %"):
            table.add_column(head, justify="right")
        for one in scores:
            shares = [float(one.curve(statistic)[0]) for statistic in ERROR_AFTER.values()]
            cells = [f"{100 * share:.1f}" if np.isfinite(share) else "-" for share in shares]
            table.add_row(escape(one.name), *cells)
        return [table]
