"""A task: what is decided, on which episodes, and what counts; and the one sweep over thresholds."""

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
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

FIGURE_SIZE = (11.5, 5.2)  # of the figure of a comparison [in]
Levels = dict[tuple[str, ...], "Metric"]
"""Figures of whole operating curves, by their keys in JSON from the outermost on."""


@dataclass(frozen=True)
class Metric:
    """A figure of a decider at one threshold, as a column of tables.

    Attributes:
        name: key in JSON.
        head: heading, with the unit.
        statistic: the figure.
        digits: after the decimal point.
        scale: factor on the figure in tables.
    """

    name: str
    head: str
    statistic: Statistic
    digits: int
    scale: float = 1.0


@dataclass(frozen=True)
class Wording:
    """What a learning curve shows of an agent, and of the classical rule beside it.

    Attributes:
        key: of the reward of the rule in the metrics, without prefix.
        rule: name of the rule in figures.
        sentence: name of the rule in a sentence.
        unit: what a mean reward is the mean of.
        measured: names of other metrics of the agent.
        text: these metrics as text, a format string.
    """

    key: str
    rule: str
    sentence: str
    unit: str
    measured: tuple[str, ...]
    text: str


@dataclass(frozen=True)
class Recorded:
    """What one decider did on E episodes.

    Attributes:
        figures: (E, F) figures of each episode, see `Task.columns`.
        samples: values of which quantiles or counts are taken, by name.
    """

    figures: FloatArray
    samples: Mapping[str, NDArray[Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class Task(ABC):
    """What is decided, in which environment, and what counts.

    Args:
        env_id: registered id of the environment.
        given: keyword arguments of the environment, which override those of the id.

    Attributes:
        switches: task of the deciders, see `baselines.rules.decider`.
        waits: whether action 0 waits, and others declare hypotheses.
        columns: names of the figures of an episode.
        metrics: figures of a decider at one threshold, in the order of tables.
        further: other figures at one threshold, for JSON.
        goal: figure that thresholds are selected for.
        episode_word: what an episode is called in the note of figures.
        notes: lines that explain the metrics below a table.
        paired: how `against` compares, as a word for headings.
        reference: name of the rule that others are compared with.
        wording: of the learning curve of an agent.
        compared, agents: names of the deciders that are compared by default.
        episodes, selection_episodes: default numbers.
    """

    env_id: str
    given: Mapping[str, Any]

    switches: ClassVar[str]
    waits: ClassVar[bool] = False
    columns: ClassVar[tuple[str, ...]]
    metrics: ClassVar[tuple[Metric, ...]]
    further: ClassVar[Mapping[str, Statistic]] = {}
    goal: ClassVar[str] = "reward"
    episode_word: ClassVar[str] = "episodes"
    notes: ClassVar[str] = ""
    paired: ClassVar[str]
    reference: ClassVar[str]
    wording: ClassVar[Wording]
    agents: ClassVar[tuple[str, ...]]
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

    @property
    def figure_note(self) -> str:
        """Text below the figure of a comparison."""
        return (
            f"Filled markers: thresholds selected on other {self.episode_word}. "
            "Arrows: the curve continues outside the axes."
        )

    @abstractmethod
    def size(self, episodes: int) -> str:
        """Return a number of episodes in words, for titles."""

    def shifted(self) -> dict[str, dict[str, Any]]:
        """Return name and changed options of the environments of a distribution shift, the nominal one first.

        Without any, there are no random worlds either.
        """
        return {}

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """Return the task with some other options."""
        return dataclasses.replace(self, given={**self.given, **changes}) if changes else self

    def settings(self, observes: str) -> Sequence[Mapping[str, Any]]:
        """Return changes of options that are tried with the thresholds, the first without any.

        observes: what the decider observes, see `Decider`.
        """
        return ({},)

    @property
    def untuned(self) -> Mapping[str, Any]:
        """Changes of options for a decider for which nothing is selected."""
        return {}

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
        on_progress: Callable[[float], None],
    ) -> list[Recorded]:
        """Roll deciders of one rule out on the same episodes.

        Args:
            deciders: at different thresholds.
            changes: options of the environment that they need, see `Decider.options`.
            episodes: number of episodes, at most `batch`.
            seed: of the first episode.
            on_progress: called with the finished share.
        """

    @abstractmethod
    def extra(self, samples: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return arrays by name for `Scores.extra`, from the samples of all episodes at one threshold."""

    @abstractmethod
    def levels(self, reference: Scores, default: float) -> Levels:
        """Return figures of whole operating curves.

        Args:
            reference: scores of the reference.
            default: its default threshold.
        """

    @abstractmethod
    def against(self, mine: Selected, reference: Selected, curves: bool) -> dict[str, dict[str, Estimate]]:
        """Return paired figures of a decider and the reference on the same episodes, by their keys in JSON.

        curves: whether both have whole operating curves.
        """

    @abstractmethod
    def panels(self, groups: Groups, complete: bool) -> list[Panel]:
        """Return the operating curves of deciders, see `agents.evaluation.curves`.

        Args:
            groups: the deciders, the reference first.
            complete: whether those after the first were scored at all thresholds.
        """

    def figure(self, groups: Groups, complete: bool) -> Figure:
        """Return the figure of a comparison, see `panels`."""
        panels = self.panels(groups, complete)
        rows = [panels[k : k + 2] for k in range(0, len(panels), 2)]
        width, height = FIGURE_SIZE
        return curve_figure(rows, (width, height * len(rows)), self.figure_title, self.figure_note)

    @property
    @abstractmethod
    def length(self) -> int:
        """Length of an episode, in units of `done`."""

    @abstractmethod
    def done(self, history: History) -> int:
        """Return the progress of the running episode: the number of decisions or of statements."""

    @abstractmethod
    def fill(self, table: Table, history: History) -> None:
        """Add columns and rows about an episode that has just ended."""

    @abstractmethod
    def track_record(self, history: History, **common: Any) -> TrackRecord:
        """Return what was declared or stated in an episode, for a figure.

        Args:
            history: the episode.
            common: the other attributes of the record.
        """

    def remarks(self, episodes: int, seed: int) -> dict[str, Any]:
        """Return what else a comparison tells of the episodes, as plain values by their keys in JSON."""
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
    on_progress: Callable[[float], None] | None = None,
    thresholds: Sequence[float] | None = None,
) -> Scores:
    """Return the scores of a decider at each threshold on the same episodes.

    Args:
        task: what is decided.
        family: of the decider.
        episodes: number of episodes, rolled out in batches.
        seed: of the first episode; later episodes use consecutive seeds.
        on_progress: called repeatedly with the finished share.
        thresholds: to use instead of those of the family.

    Raises:
        ArgumentError: the episodes would fill the memory.
    """
    task.check_episodes("episodes", episodes)
    used = family.thresholds if thresholds is None else tuple(thresholds)
    deciders = [family.make(threshold) for threshold in used]
    together = len(deciders) > 1 and as_decider(deciders[0]).together(deciders[:1]) is not None
    groups = [deciders] if together else [[decider] for decider in deciders]
    size, total = task.batch(), episodes * len(deciders)
    found: list[list[Recorded]] = [[] for _ in used]
    done = 0
    for first in range(0, episodes, size):
        count = min(size, episodes - first)
        place = 0
        for group in groups:

            def show(share: float, before: int = done, width: int = count * len(group)) -> None:
                if on_progress is not None:
                    on_progress((before + share * width) / total)

            recorded = task.record(group, family.options, count, seed + first, show)
            for one in recorded:
                found[place].append(one)
                place += 1
            done += count * len(group)
            show(0.0, done)
    return gather(task, family, used, found)


def gather(
    task: Task, family: DeciderFamily, thresholds: tuple[float, ...], found: Sequence[Sequence[Recorded]]
) -> Scores:
    """Return the scores of a decider from what was recorded in several batches at every threshold."""
    values = np.stack([np.concatenate([part.figures for part in parts]) for parts in found], axis=-1)
    samples = [
        {name: np.concatenate([part.samples[name] for part in parts]) for name in parts[0].samples} for parts in found
    ]
    extra = [task.extra(one) for one in samples]
    return Scores(
        family.name, family.symbol, thresholds, task.columns, values,
        {name: np.stack([one[name] for one in extra]) for name in extra[0]},
    )  # fmt: skip
