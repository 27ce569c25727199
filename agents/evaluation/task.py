"""A task: what is decided, on which episodes, and what counts; and the one sweep over
thresholds.
"""

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from baselines.rules.decider import Decider
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores, Statistic
from hybrid_env.checks import FloatArray
from hybrid_env.options import ModelOptions
from hybrid_env.registration import make_track_vector_env

Levels = dict[tuple[str, ...], "Metric"]
"""Figures of whole operating curves, by their keys in JSON from the outermost on."""
# Called with the finished share.
OnProgress = Callable[[float], None]


@dataclass(frozen=True)
class Metric:
    """A figure of a decider at one threshold, as a column of tables."""

    # Key in JSON.
    name: str
    # Heading, with the unit.
    head: str
    statistic: Statistic
    # After the decimal point.
    digits: int
    # Factor on the figure in tables.
    scale: float = 1.0


@dataclass(frozen=True)
class Recorded:
    """What one decider did on E episodes."""

    # (E, F) figures of each episode, see `Task.columns`
    figures: FloatArray
    # Values of which quantiles or counts are taken, by name.
    samples: Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Selected:
    """Scores of a decider, and the threshold selected for it."""

    # At all its thresholds, or at the selected one.
    scores: Scores
    # Index of the threshold that was selected on other episodes.
    chosen: int


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
    # Names of the figures of an episode.
    columns: ClassVar[tuple[str, ...]]
    # Figures of a decider at one threshold, in the order of tables.
    metrics: ClassVar[tuple[Metric, ...]]
    # Other figures, of a table and of JSON beside them.
    further: ClassVar[tuple[Metric, ...]] = ()
    # Figure that thresholds are selected for.
    goal: ClassVar[str] = "reward"
    # Lines that explain the metrics below a table.
    notes: ClassVar[str] = ""
    # Name of the rule that others are compared with.
    reference: ClassVar[str]
    # Key of the paired figures in JSON, see `against`.
    paired: ClassVar[str]
    # What a mean reward is the mean of: "segment" or "tick".
    unit: ClassVar[str]
    # Episodes, selection_episodes: default numbers.
    episodes: ClassVar[int]
    selection_episodes: ClassVar[int]

    @cached_property
    def options(self) -> Any:
        """All options of the environment, including the defaults of the id."""
        return self.options_with({})

    def options_with(self, changes: Mapping[str, Any]) -> ModelOptions:
        """Return all options of the environment with some changes."""
        return make_track_vector_env(self.env_id, 1, **{**self.given, **changes}).options

    @property
    def title(self) -> str:
        """Name of the environment in titles."""
        return self.env_id.rpartition(":")[2]

    @abstractmethod
    def size(self, episodes: int) -> str:
        """Return a number of episodes in words, for titles."""

    @abstractmethod
    def shifted(self) -> dict[str, dict[str, Any]]:
        """Return name and changed options of the environments of a distribution shift, the
        nominal one first.
        """

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """Return the task with some other options."""
        return dataclasses.replace(self, given={**self.given, **changes}) if changes else self

    @property
    @abstractmethod
    def agents(self) -> tuple[str, ...]:
        """Names of the agents that are compared by default."""

    @property
    @abstractmethod
    def compared(self) -> tuple[str, ...]:
        """Names of the rules that are compared by default, the reference first."""

    @abstractmethod
    def check_episodes(self, name: str, episodes: int) -> None:
        """Raise `ArgumentError` if the episodes would fill the memory; `name` is the argument."""

    @abstractmethod
    def batch(self) -> int:
        """Return the largest number of episodes that are rolled out at the same time."""

    @abstractmethod
    def record(
        self, decider: Decider, episodes: int, seed: int, on_progress: OnProgress
    ) -> list[Recorded]:
        """Roll a decider out on at most `batch` episodes, at one threshold or at several ones."""

    @abstractmethod
    def extra(self, samples: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return arrays by name for `Scores.extra`, from the samples of all episodes at one
        threshold.
        """

    @abstractmethod
    def levels(self, reference: Scores, default: float) -> Levels:
        """Return figures of whole operating curves, from the scores of the reference and its
        default threshold.
        """

    @abstractmethod
    def against(self, mine: Selected, reference: Selected, curves: bool) -> dict[str, Estimate]:
        """Return paired figures of a decider and the reference by name; `curves`: at all
        thresholds.
        """

    @property
    def length(self) -> int:
        """Number of segments to declare, or of ticks to state, in an episode."""
        return int(getattr(self.options, f"{self.unit}s"))

    def remarks(self, episodes: int, seed: int) -> dict[str, Any]:
        """Return what else a comparison tells of the episodes, as plain values by their keys in
        JSON.
        """
        return {}

    def statistic(self, name: str) -> Statistic:
        """Return the statistic of a metric."""
        return next(metric.statistic for metric in self.metrics if metric.name == name)

    def figures(self, scores: Scores, index: int | None = None) -> dict[str, Estimate]:
        """Return the metrics of scores by name, at the threshold of an index or at the only one."""
        return {metric.name: scores.estimate(metric.statistic, index) for metric in self.metrics}

    def best(self, scores: Scores) -> int:
        """Return the index of the threshold that is best for the goal."""
        return int(scores.curve(self.statistic(self.goal)).argmax())


def sweep(
    task: Task,
    decider: Decider,
    episodes: int,
    seed: int,
    on_progress: OnProgress = lambda share: None,
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
    width = len(used) // len(deciders)
    size = task.batch()
    total = episodes * len(used)
    # In each batch at every threshold.
    recorded: list[list[Recorded]] = []
    done = 0
    for first in range(0, episodes, size):
        count = min(size, episodes - first)
        recorded.append([])
        for each in deciders:

            def show(share: float, before: int = done, part: int = count * width) -> None:
                on_progress((before + share * part) / total)

            recorded[-1] += task.record(each, count, seed + first, show)
            done += count * width
            show(0.0, done)
    return gather(task, decider, used, [*zip(*recorded, strict=True)])


def gather(
    task: Task,
    decider: Decider,
    thresholds: tuple[float, ...],
    recorded: Sequence[Sequence[Recorded]],
) -> Scores:
    """Return the scores of a decider from what was recorded in several batches at every
    threshold.
    """
    values = np.stack(
        [np.concatenate([part.figures for part in parts]) for parts in recorded],
        axis=-1,
    )
    extra = [
        task.extra(
            {
                name: np.concatenate([part.samples[name] for part in parts])
                for name in parts[0].samples
            }
        )
        for parts in recorded
    ]
    stacked = {name: np.stack([arrays[name] for arrays in extra]) for name in extra[0]}
    bank = getattr(task.options_with(decider.options), "bank", "")
    return Scores(decider.title, decider.symbol, thresholds, task.columns, values, stacked, bank)
