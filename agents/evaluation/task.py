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
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.table import Table

from agents.evaluation.curves import Groups, Selected
from agents.figures.curves import Panel, curve_figure
from agents.figures.tracks import TrackRecord
from baselines.rules.decider import DeciderFamily
from baselines.rules.own import as_decider
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores, Statistic
from hybrid_env.checks import FloatArray
from hybrid_env.options import ModelOptions
from hybrid_env.registration import make_track_vector_env
from hybrid_env.rendering.history import History

# Of the figure of a comparison [in].
FIGURE_SIZE = (13.0, 5.2)
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
class Wording:
    """What a learning curve shows of an agent, and of the classical rule beside it."""

    # Of the reward of the rule in the metrics, without prefix.
    key: str
    # Name of the rule in figures.
    rule: str
    # Name of the rule in a sentence.
    sentence: str
    # What a mean reward is the mean of.
    unit: str
    # Names of other metrics of the agent.
    measured: tuple[str, ...]
    # These metrics as text, a format string.
    text: str


@dataclass(frozen=True)
class Recorded:
    """What one decider did on E episodes."""

    # (E, F) figures of each episode, see `Task.columns`
    figures: FloatArray
    # Values of which quantiles or counts are taken, by name.
    samples: Mapping[str, NDArray[Any]]


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
    # Other figures at one threshold, for JSON.
    further: ClassVar[Mapping[str, Statistic]] = {}
    # Figure that thresholds are selected for.
    goal: ClassVar[str] = "reward"
    figure_note: ClassVar[str] = "Filled markers: thresholds selected on other episodes."
    # Lines that explain the metrics below a table.
    notes: ClassVar[str] = ""
    # How `against` compares, as a word for headings.
    paired: ClassVar[str]
    # Name of the rule that others are compared with.
    reference: ClassVar[str]
    # Of the learning curve of an agent.
    wording: ClassVar[Wording]
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

    @property
    def figure_title(self) -> str:
        """Title of the figure of a comparison."""
        variances = " and ".join(f"{variance:g}" for variance in self.options.variances)
        return f"{self.title}: {self.options.hypotheses} hypotheses, R = {variances} m²"

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
        self,
        deciders: Sequence[Any],
        changes: Mapping[str, Any],
        episodes: int,
        seed: int,
        on_progress: OnProgress,
    ) -> list[Recorded]:
        """Roll a rule at different thresholds out on at most `batch` episodes; `changes` are
        options it needs.
        """

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
    def against(
        self,
        mine: Selected,
        reference: Selected,
        curves: bool,
    ) -> dict[str, dict[str, Estimate]]:
        """Return paired figures of a decider and the reference by keys in JSON; `curves`: at all
        thresholds.
        """

    @abstractmethod
    def panels(self, groups: Groups) -> list[Panel]:
        """Return the operating curves of deciders, the reference first."""

    def figure(self, groups: Groups) -> Figure:
        """Return the figure of a comparison, see `panels`."""
        panels = self.panels(groups)
        rows = [panels[k : k + 2] for k in range(0, len(panels), 2)]
        width, height = FIGURE_SIZE
        return curve_figure(rows, (width, height * len(rows)), self.figure_title, self.figure_note)

    @property
    def length(self) -> int:
        """Number of segments to declare, or of ticks to state, in an episode."""
        return int(getattr(self.options, f"{self.wording.unit}s"))

    @abstractmethod
    def episode_table(self, title: str, history: History) -> Table:
        """Return a table of an episode that has just ended."""

    @abstractmethod
    def track_record(self, history: History, **common: Any) -> TrackRecord:
        """Return what was declared or stated in an episode, for a figure; `common` has the other
        attributes.
        """

    def remarks(self, episodes: int, seed: int) -> dict[str, Any]:
        """Return what else a comparison tells of the episodes, as plain values by their keys in
        JSON.
        """
        return {}

    def further_tables(self, scores: Sequence[Scores], remarks: Mapping[str, Any]) -> list[Table]:
        """Return further tables, of deciders at one threshold each and of `remarks`."""
        return []

    def statistic(self, name: str) -> Statistic:
        """Return the statistic of a metric."""
        return next(metric.statistic for metric in self.metrics if metric.name == name)

    def best(self, scores: Scores) -> int:
        """Return the index of the threshold that is best for the goal."""
        return int(scores.curve(self.statistic(self.goal)).argmax())


def sweep(
    task: Task,
    family: DeciderFamily,
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
    used = family.thresholds if thresholds is None else tuple(thresholds)
    deciders = [family.make(threshold) for threshold in used]
    together = len(deciders) > 1 and as_decider(deciders[0]).together(deciders[:1]) is not None
    groups = [deciders] if together else [[decider] for decider in deciders]
    size = task.batch()
    total = episodes * len(deciders)
    # In each batch at every threshold.
    found: list[list[Recorded]] = []
    done = 0
    for first in range(0, episodes, size):
        count = min(size, episodes - first)
        found.append([])
        for group in groups:

            def show(share: float, before: int = done, width: int = count * len(group)) -> None:
                on_progress((before + share * width) / total)

            found[-1] += task.record(group, family.options, count, seed + first, show)
            done += count * len(group)
            show(0.0, done)
    return gather(task, family, used, [*zip(*found, strict=True)])


def gather(
    task: Task,
    family: DeciderFamily,
    thresholds: tuple[float, ...],
    found: Sequence[Sequence[Recorded]],
) -> Scores:
    """Return the scores of a decider from what was recorded in several batches at every
    threshold.
    """
    values = np.stack(
        [np.concatenate([part.figures for part in parts]) for parts in found],
        axis=-1,
    )
    extra = [
        task.extra(
            {
                name: np.concatenate([part.samples[name] for part in parts])
                for name in parts[0].samples
            }
        )
        for parts in found
    ]
    stacked = {name: np.stack([one[name] for one in extra]) for name in extra[0]}
    bank = getattr(task.options_with(family.options), "bank", "")
    return Scores(family.name, family.symbol, thresholds, task.columns, values, stacked, bank)
