"""A task: what is decided, on which episodes, and what counts; and the one sweep over
thresholds.
"""

import dataclasses
import functools
import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from baselines.rules import seeds
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Decider, rules
from baselines.rules.rollout import batch_size, record_decisions, record_in, statement_env
from baselines.scoring import decisions, statements
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores, Statistic, at_level, interpolated, mean, quotient
from hybrid_env.checks import AnyArray, FloatArray, check_integer
from hybrid_env.options import ModelOptions
from hybrid_env.registration import environment_options, make_track_vector_env

# (E, F) values of E episodes at one threshold, see `Task.columns`, and by name values of which
# quantiles or counts are taken.
Recorded = tuple[FloatArray, Mapping[str, AnyArray]]


@dataclass(frozen=True)
class Metric:
    """A value of a decider at one threshold, as a column of tables."""

    # Key in JSON.
    name: str
    # Heading, with the unit.
    head: str
    statistic: Statistic
    # After the decimal point.
    digits: int
    # Factor on the value in tables.
    scale: float = 1.0


@dataclass(frozen=True)
class Task(ABC):
    """What is decided, in which environment, and what counts."""

    # Registered id of the environment.
    env_id: str
    # Keyword arguments of the environment, which override those of the id.
    given: Mapping[str, Any]

    # Task of the deciders, see `baselines.rules.decider`.
    switches: ClassVar[str]
    # Whether action 0 waits, and others declare hypotheses.
    waits: ClassVar[bool] = False
    # Names of the values of an episode.
    columns: ClassVar[tuple[str, ...]]
    # Figures of a decider at one threshold, in the order of tables.
    metrics: ClassVar[tuple[Metric, ...]]
    # Figure of the delay that is traded for errors.
    delay: ClassVar[str]
    # Unit of the error rate that a threshold can be chosen for, and the number of episodes that
    # are simulated for it at every threshold.
    rate_unit: ClassVar[str]
    choosing_episodes: ClassVar[int]
    # Lines that explain the metrics below a table.
    notes: ClassVar[str] = ""
    # Name of the rule that others are compared with, and of the recipes of agents that are trained
    # and compared by default.
    reference: ClassVar[str]
    recipes: ClassVar[tuple[str, ...]] = ()
    # What a mean reward is the mean of: "segment" or "tick".
    unit: ClassVar[str]
    # Number of segments or ticks whose results fill half a gigabyte.
    largest: ClassVar[int]
    # Default numbers of episodes, to report and to select thresholds on.
    episodes: ClassVar[int]
    selection_episodes: ClassVar[int]

    @cached_property
    def options(self) -> Any:
        """All options of the environment, including the defaults of the id."""
        return make_track_vector_env(self.env_id, 1, **self.given).options

    @property
    def title(self) -> str:
        """Name of the environment in titles."""
        return self.env_id.rpartition(":")[2]

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """Return the task with some other options."""
        return dataclasses.replace(self, given={**self.given, **changes})

    @property
    def length(self) -> int:
        """Number of segments to declare, or of ticks to state, in an episode."""
        return int(getattr(self.options, f"{self.unit}s"))

    @property
    @abstractmethod
    def deciders(self) -> tuple[str, ...]:
        """Names of the rules that are compared by default, the reference first."""

    @property
    def shipped(self) -> tuple[str, ...]:
        """Names of the agents of the package that are compared by default; they are for straight
        motion and turns.
        """
        return ("shipped",) if self.options.modes is None else ()

    @property
    def several_of_type(self) -> bool:
        """Whether a type of motion has several modes."""
        return len(self.options.type_names) < self.options.hypotheses

    @property
    def shown(self) -> tuple[Metric, ...]:
        """The metrics of tables: figures of types only where a type has several modes."""
        return tuple(
            metric
            for metric in self.metrics
            if self.several_of_type or not metric.name.startswith("type_")
        )

    def size(self, episodes: int) -> str:
        """Return a number of episodes in words, for titles."""
        return f"{episodes * self.length:,} {self.unit}s"

    def check_episodes(self, name: str, episodes: int) -> None:
        """Raise `ArgumentError` if the episodes would fill the memory; `name` is the argument."""
        check_integer(name, episodes, maximum=max(1, self.largest // self.length))

    @abstractmethod
    def batch(self) -> int:
        """Return the largest number of episodes that are rolled out at the same time."""

    @abstractmethod
    def record(
        self, decider: Decider, episodes: int, seed: int, on_progress: Callable[[float], None]
    ) -> list[Recorded]:
        """Roll a decider out on at most `batch` episodes, at one threshold or at several ones.
        on_progress: called with the finished share.
        """

    @abstractmethod
    def error_rates(self, scores: Scores) -> FloatArray:
        """Return the error rate at every threshold, in `rate_unit`."""

    @abstractmethod
    def extra(self, samples: Mapping[str, AnyArray]) -> dict[str, AnyArray]:
        """Return arrays by name for `Scores.extra`, from the samples of all episodes at one
        threshold.
        """

    @abstractmethod
    def levels(self, reference: Scores, default: float) -> tuple[Metric, ...]:
        """Return values of whole operating curves, from the scores of the reference and its
        default threshold.
        """

    def statistic(self, name: str) -> Statistic:
        """Return the statistic of a metric."""
        return next(metric.statistic for metric in self.metrics if metric.name == name)

    def estimates(self, scores: Scores, index: int | None = None) -> dict[str, Estimate]:
        """Return all metrics of scores by name, at the threshold of an index or at the only
        one.
        """
        return {metric.name: scores.estimate(metric.statistic, index) for metric in self.metrics}

    def best(self, scores: Scores) -> int:
        """Return the index of the threshold with the largest mean reward."""
        return int(scores.curve(self.statistic("reward")).argmax())


class AnnouncedTask(Task):
    """Every switch is announced, and the mode of the segment is declared once."""

    switches = ANNOUNCED
    waits = True
    columns = decisions.Decisions.columns
    metrics = (
        Metric("accuracy", "accuracy\n%", mean("accuracy", share=True), 1, 100.0),
        Metric("type_accuracy", "type\naccuracy, %", mean("type_accuracy", share=True), 1, 100.0),
        Metric("ticks", "mean\nticks", mean("ticks"), 1),
        Metric("reward", "mean\nreward", mean("reward"), 3),
        Metric("forced", "undecided\n%", mean("forced", share=True), 1, 100.0),
        Metric(
            "rmse",
            "RMSE\nm",
            Statistic(("squared_error", "length"), lambda sum_, n: np.sqrt(quotient(sum_, n))),
            3,
        ),
    )
    delay = "ticks"
    rate_unit = "%"
    choosing_episodes = 400
    reference = "ate"
    recipes = ("ppo",)
    unit = "segment"
    largest = 10_000_000
    episodes = 1500
    selection_episodes = seeds.SELECTION_EPISODES

    @property
    def deciders(self) -> tuple[str, ...]:
        """See `Task.deciders`."""
        if self.options.bank == "published" and self.options.modes is None:
            return (self.reference, "at-once", "msprt", "msprt-kept", "propagated")
        by_type = self.options.correctness == "type"
        return (self.reference, "at-once", "sprt", "msprt-type" if by_type else "msprt")

    def batch(self) -> int:
        return batch_size(self.options)

    def record(
        self, decider: Decider, episodes: int, seed: int, on_progress: Callable[[float], None]
    ) -> list[Recorded]:
        options = {**self.given, **decider.options}
        made = record_decisions(decider, self.env_id, episodes, seed, on_progress, **options)
        modes = np.stack([made.true_mode.ravel(), made.decided_mode.ravel()], axis=1)
        return [(made.values, {"modes": modes})]

    def error_rates(self, scores: Scores) -> FloatArray:
        """Return the share of wrong declarations."""
        accuracy = "accuracy" if self.options.correctness == "exact" else "type_accuracy"
        return 100.0 * (1.0 - scores.curve(self.statistic(accuracy)))

    def extra(self, samples: Mapping[str, AnyArray]) -> dict[str, AnyArray]:
        """Return the confusion matrix (M, M): true mode in rows, decided mode in columns."""
        counts = np.zeros((self.options.hypotheses,) * 2, np.int64)
        np.add.at(counts, tuple(samples["modes"].T), 1)
        return {"confusion": counts}

    def levels(self, reference: Scores, default: float) -> tuple[Metric, ...]:
        """Return the error rate at the mean time of the reference, and the mean times at two
        accuracies.
        """
        ticks = float(reference.curve(mean("ticks"))[reference.thresholds.index(default)])
        right = interpolated("ticks", ticks, "accuracy")
        wrong = Statistic(right.columns, lambda *means: 1.0 - right.function(*means), share=True)
        return (
            Metric("equal_time_error", f"error, %\nat {ticks:.1f}", wrong, 2, 100.0),
            Metric("ticks_at_95", "ticks at\n95%", at_level("accuracy", 0.95, mean("ticks")), 1),
            Metric("ticks_at_98", "ticks at\n98%", at_level("accuracy", 0.98, mean("ticks")), 1),
        )


class UnknownTask(Task):
    """Nobody announces switches, and the present mode is stated at every tick."""

    switches = UNKNOWN
    # Of the modes, then of their types: straight, left, right.
    columns = tuple(
        kind + name for kind in ("", "type_") for name in statements.StatementMetrics.columns()
    )
    metrics = (
        *(
            Metric(name, head, statements.STATISTICS[name], digits, scale)
            for name, head, digits, scale in (
                ("reward", "reward", 4, 1.0),
                ("right", "right\n%", 1, 100.0),
                ("delay", "delay\nmean", 1, 1.0),
                ("missed", "missed\n%", 1, 100.0),
                ("full_delay", "delay,\nall", 1, 1.0),
                ("wrong_changes", "wrong\n/1000", 2, 1.0),
                ("change_ratio", "changes", 2, 1.0),
            )
        ),
        Metric("type_delay", "type\ndelay", statements.of_types("delay"), 1),
        Metric("type_missed", "type\nmissed, %", statements.of_types("missed"), 1, 100.0),
    )
    notes = (
        "delay: ticks from a switch to the first right statement; 50 and 90 % quantiles.\n"
        "missed: switches followed by another one before the new mode was stated.\n"
        "delay, all: a switch that is not detected counts until the end of its segment.\n"
        "wrong: changes of the statement to a wrong mode per 1,000 ticks.\n"
        "changes: of the statement, per switch."
    )
    delay = "full_delay"
    rate_unit = "/1000"
    # Wrong changes per 1,000 ticks at which delays are compared.
    equal_wrong_changes = 2.0
    choosing_episodes = 60
    reference = "threshold"
    unit = "tick"
    largest = 100_000_000
    episodes = 500
    selection_episodes = 300

    @property
    def deciders(self) -> tuple[str, ...]:
        """All rules; see `Task.deciders`."""
        return tuple(dict.fromkeys((self.reference, *rules(UNKNOWN))))

    def batch(self) -> int:
        # A million statements with 3 modes need about 500 MB with 20 thresholds.
        return max(1, 3_000_000 // (self.options.ticks * self.options.hypotheses))

    def record(
        self, decider: Decider, episodes: int, seed: int, on_progress: Callable[[float], None]
    ) -> list[Recorded]:
        options = self.changed(decider.options).options
        make = functools.partial(statement_env, options, episodes)
        every = options.decide_every
        recorded = record_in(make, decider, seed, decide_every=every)
        return [self.measured(stated) for stated in recorded]

    def measured(self, recorded: statements.Statements) -> Recorded:
        """Return the values of recorded statements, of modes and of types."""
        cost = self.options.change_cost
        metrics = of_types = statements.measure_statements(recorded, cost)
        if self.several_of_type:
            named = statements.Statements(*(self.options.types[modes] for modes in recorded))
            of_types = statements.measure_statements(named, cost)
        values = np.hstack([metrics.values, of_types.values])
        return values, {"delays": metrics.delays}

    def error_rates(self, scores: Scores) -> FloatArray:
        """Return the wrong changes in 1,000 ticks."""
        return scores.curve(self.statistic("wrong_changes"))

    def extra(self, samples: Mapping[str, AnyArray]) -> dict[str, AnyArray]:
        """Return quantiles of detected delays [ticks]."""
        delays = samples["delays"]
        quantiles = np.quantile(delays, (0.5, 0.9)) if delays.size else np.full(2, np.nan)
        return {"delay_quantiles": quantiles}

    def levels(self, reference: Scores, default: float) -> tuple[Metric, ...]:
        """Return delays and misses at an equal rate of wrong changes; those at the first
        threshold if that already has fewer.
        """

        def at_equal_rate(name: str) -> Statistic:
            statistic = statements.STATISTICS[name]
            return at_level("wrong_changes", self.equal_wrong_changes, statistic, falling=True)

        return tuple(
            Metric(f"{name}_at_equal_wrong_changes", head, at_equal_rate(name), 1, scale)
            for name, head, scale in (
                ("full_delay", "delay,\nall", 1.0),
                ("delay", "delay\nof detected", 1.0),
                ("missed", "missed\n%", 100.0),
            )
        )


def task_of(env_id: str, given: Mapping[str, Any] | None = None) -> Task:
    """Return the task of an environment."""
    options: Any = environment_options(env_id)
    kind = AnnouncedTask if options.switches == ANNOUNCED else UnknownTask
    return kind(env_id, dict(given or {}))


def task_with(options: ModelOptions) -> Task:
    """Return the task of an environment with all its options given."""
    name = "Published" if options.switches == ANNOUNCED else "Quickest"
    return task_of(f"hybrid_env:HybridTrack{name}-v0", vars(options))


def sweep(
    task: Task,
    decider: Decider,
    episodes: int,
    seed: int,
    on_progress: Callable[[float], None] = lambda share: None,
    thresholds: Sequence[float] | None = None,
) -> Scores:
    """Return the scores of a decider at each threshold, or at those given, on the same episodes.

    Episodes have consecutive seeds and are rolled out in batches. `on_progress` is called with the
    finished share.
    """
    task.check_episodes("episodes", episodes)
    used = decider.thresholds if thresholds is None else tuple(thresholds)
    several = decider.sweeps and len(used) > 1
    deciders = [decider.at(used)] if several else [decider.at(threshold) for threshold in used]
    size = task.batch()
    parts = list(itertools.product(range(0, episodes, size), deciders))
    recorded: list[Recorded] = []
    for number, (first, each) in enumerate(parts):

        def show(share: float, before: int = number) -> None:
            on_progress((before + share) / len(parts))

        recorded += task.record(each, min(size, episodes - first), seed + first, show)
        show(1.0)
    values = []
    extra = []
    for index in range(len(used)):
        # In every batch.
        batches, samples = zip(*recorded[index :: len(used)], strict=True)
        values.append(np.concatenate(batches))
        names = samples[0]
        extra.append(
            task.extra({name: np.concatenate([batch[name] for batch in samples]) for name in names})
        )
    return Scores(
        decider.title,
        decider.symbol,
        used,
        task.columns,
        np.stack(values, axis=-1),
        {name: np.stack([arrays[name] for arrays in extra]) for name in extra[0]},
        getattr(task.changed(decider.options).options, "bank", ""),
    )
