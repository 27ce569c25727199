"""Episodes of a decider on one track: played for a window or an animation, or recorded for a figure."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table

from agents.evaluation.registry import load_decider
from agents.evaluation.task import Task
from agents.figures.timelines import UNDECIDED
from agents.figures.tracks import TrackRecord
from baselines.rules.decider import ANNOUNCED
from baselines.rules.rollout import rollout
from baselines.scoring.statements import Statements, measure_statements
from hybrid_env.env import TrackEnv
from hybrid_env.rendering.evidence import mode_name
from hybrid_env.rendering.history import ACTIVE, TRACE_INDEX, History
from hybrid_env.rendering.window import Renderer


class OneTrack:
    """An environment of one track with the interface of a vector environment.

    Args:
        env: the environment.
    """

    num_envs = 1

    def __init__(self, env: TrackEnv):
        self.env = env

    @property
    def world(self) -> Any:
        """Arrays of the track."""
        return self.env.world

    def reset(self, *, seed: int | None = None) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode."""
        row, info = self.env.reset(seed=seed)
        return row[None], info

    def step(self, actions: NDArray[np.int64]) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step the track."""
        row, reward, terminated, truncated, info = self.env.step(int(actions[0]))
        return row[None], np.array([reward]), np.array([terminated]), np.array([truncated]), info


class Episodes:
    """Episodes of a decider on one track.

    Args:
        task: what is decided.
        name: of the decider, with an optional threshold; empty for the reference of the task.
        decider: to use in place of the one of this name.
        changes: options of the environment that it needs.

    Attributes:
        env: environment with the render mode "rgb_array".
        name: of the decider.
        decider: the decider.
        length: of an episode, in units of `done`.

    Raises:
        ArgumentError: the decider is unknown, or not for this environment.
    """

    def __init__(self, task: Task, name: str = "", decider: Any = None, changes: Any = None):
        options = {**task.given, **(changes or {})}
        env = gym.make(task.env_id, render_mode="rgb_array", **options).unwrapped
        assert isinstance(env, TrackEnv)
        self.env, self.name = env, name or task.reference
        self.decider = load_decider(self.name, env.options) if decider is None else decider
        self.announced = task.switches == ANNOUNCED
        self.length = env.options.segments if self.announced else env.options.ticks

    @property
    def history(self) -> History:
        """The running episode."""
        assert self.env.history is not None
        return self.env.history

    @property
    def done(self) -> int:
        """Progress of the running episode: number of decisions or of statements."""
        return len(self.history.decisions if self.announced else self.history.trace)

    def renderer(self, human: bool) -> Renderer:
        """Return a renderer with the evidence of the decider, of a window if `human`."""
        return Renderer(self.env.options, human, self.decider.panel())

    def play(self, seed: int, on_step: Callable[[], None]) -> Iterator[History]:
        """Play an episode; yield its history before every step, with the evidence of the decider.

        Args:
            seed: of the episode.
            on_step: called after every step.
        """
        for now in rollout(OneTrack(self.env), self.decider, seed):
            if now.step:
                on_step()
            if now.terminated[0]:
                return
            self.history.set_evidence(self.decider.evidence(now.seen, now.state, now.starts)[0])
            yield self.history

    def table(self, title: str) -> Table:
        """Return a table of the episode that has just ended."""
        table = Table(title=escape(title), title_justify="left", caption_justify="left")
        fill = _fill_decisions if self.announced else _fill_statements
        fill(table, self.history, self.env.options)
        return table

    def record(self, name: str, seed: int) -> TrackRecord:
        """Play an episode and return what was declared or stated at every tick.

        A declaration is a statement from its tick to the end of the segment; before it nothing is stated.

        Args:
            name: of the decider in the figure.
            seed: of the episode.
        """
        for _ in self.play(seed, lambda: None):
            pass
        history, columns = self.history, TRACE_INDEX
        trace, true, stated = history.trace, history.true_modes, history.trace[:, ACTIVE].astype(np.int64)
        positions = {
            key: trace[:, [columns[f"{key}x"], columns[f"{key}y"]]] for key in ("", "measured_", "estimate_")
        }
        common: dict[str, Any] = {
            "name": name, "truth": positions[""], "measurements": positions["measured_"], "true_modes": true,
            "estimates": positions["estimate_"],
        }  # fmt: skip
        if not self.announced:
            return TrackRecord(
                **common,
                modes=stated,
                right=true == stated,
                marks=np.flatnonzero(np.diff(stated, prepend=stated[:1])),
                switches=None,
                summary=_summary(true, stated, self.env.options.change_cost),
            )
        decisions = history.decisions
        lengths, ticks, correct = (
            np.array([getattr(one, key) for one in decisions]) for key in ("length", "ticks", "correct")
        )
        switches = np.cumsum(lengths) - lengths
        since = np.arange(len(trace)) - np.repeat(switches, lengths)
        rewards = np.where(correct, 1.0, -1.0) - self.env.options.delay_cost * ticks
        return TrackRecord(
            **common,
            modes=np.where(since < np.repeat(ticks, lengths), UNDECIDED, stated),
            right=np.repeat(correct, lengths),
            marks=switches + ticks - 1,
            switches=switches,
            summary=f"{rewards.mean():+.2f}",
        )


def _summary(true: NDArray[np.int64], stated: NDArray[np.int64], change_cost: float) -> str:
    metrics = measure_statements(Statements(true[:, None], stated[:, None]), change_cost)
    right, reward = f"{100 * metrics.right[0]:.1f} %", f"{metrics.reward[0]:.3f}"
    mean_delay = metrics.value("delay")
    delay = "no switch detected" if np.isnan(mean_delay) else f"mean delay {mean_delay:.1f} ticks"
    wrong = round(1e-3 * len(true) * float(metrics.wrong_changes[0]))
    return f"{right} of the ticks right, {delay}, {wrong} changes to a wrong mode, mean reward {reward}"


def _fill_decisions(table: Table, history: History, options: Any) -> None:
    """Add one row for each decision."""
    for name in ("segment", "true mode", "decided mode", "decision"):
        table.add_column(name)
    table.add_column("ticks", justify="right")
    for number, decision in enumerate(history.decisions, start=1):
        verdict = "[green]correct[/]" if decision.correct else "[red]wrong[/]"
        table.add_row(
            str(number),
            mode_name(decision.true_mode, options.radii),
            mode_name(decision.mode, options.radii),
            verdict + (", forced" if decision.forced else ""),
            f"{decision.ticks} of {decision.length}",
        )


def _fill_statements(table: Table, history: History, options: Any) -> None:
    """Add one row for each segment, and metrics of the episode."""
    true, stated = history.true_modes, history.trace[:, ACTIVE].astype(np.int64)
    right = true == stated
    wrong = (np.diff(stated, prepend=stated[:1]) != 0) & ~right
    metrics = measure_statements(Statements(true[:, None], stated[:, None]), options.change_cost)
    table.caption = f"right {metrics.right[0]:.1%}, reward {metrics.reward[0]:.3f} per tick"
    table.add_column("segment")
    table.add_column("true mode")
    for name in ("ticks", "ticks until stated", "right", "wrong changes"):
        table.add_column(name, justify="right")
    bounds = [*history.switches.tolist(), len(true)]
    for number, (first, end) in enumerate(pairwise(bounds), start=1):
        inside = right[first:end]
        table.add_row(
            str(number),
            mode_name(int(true[first]), options.radii),
            str(end - first),
            str(inside.argmax()) if inside.any() else "[red]never[/]",
            f"{inside.mean():.0%}",
            str(wrong[first:end].sum()),
        )
