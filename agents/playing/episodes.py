"""Episodes of a decider on one track, with announced or with unknown switch moments."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from rich.markup import escape
from rich.table import Table

from agents.evaluation.deciders import load_decider
from agents.evaluation.statement_deciders import statement_decider
from baselines.rules.metrics import measure_statements
from baselines.rules.msprt import bank_posterior
from baselines.rules.statements import Statements
from baselines.rules.threshold import bank_probabilities
from hybrid_env.model_options import ModelOptions
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import environment_options
from hybrid_env.rendering.evidence import EvidencePanel, posterior_panel, probability_panel
from hybrid_env.rendering.history import ACTIVE, History
from hybrid_env.rendering.modes import mode_name
from hybrid_env.rendering.renderer import Renderer
from hybrid_env.track_env import TrackEnv


class Task(NamedTuple):
    """What is decided in an environment.

    Attributes:
        default: name of the decider if none is given.
        load: returns the decider for its name and the options of the environment.
        panel, evidence: of deciders without a panel and evidence of their own; see `Decider`.
        length: of an episode, in units of `done`.
        done: progress of an episode.
        fill: adds columns and rows to the table of an episode.
    """

    default: str
    load: Callable[[str, Any], Any]
    panel: EvidencePanel
    evidence: Callable[..., Any]
    length: Callable[[Any], int]
    done: Callable[[History], int]
    fill: Callable[[Table, History, Any], None]


def task_of(env_id: str) -> Task:
    """Return what is decided in an environment: a mode for each segment, or the mode at every tick."""
    return STATEMENTS if issubclass(environment_options(env_id), QuickestOptions) else DECISIONS


class Episodes:
    """Episodes of a decider on one track.

    Args:
        env_id: registered id of the environment.
        options: keyword arguments of the environment.
        name: of the decider; None for the default of the task.

    Attributes:
        env: environment with the render mode "rgb_array".
        name: of the decider.
        decider: the decider.
        panel: of the evidence that it compares with its threshold.
        length: of an episode, in units of `done`.

    Raises:
        ArgumentError: the decider is unknown, or not for this environment.
    """

    def __init__(self, env_id: str, options: dict[str, Any], name: str | None = None):
        self._task = task_of(env_id)
        env = gym.make(env_id, render_mode="rgb_array", **options).unwrapped
        assert isinstance(env, TrackEnv)
        self.env, self.name = env, name or self._task.default
        self.decider = self._task.load(self.name, env.options)
        own = hasattr(self.decider, "evidence")
        self.panel: EvidencePanel = self.decider.panel() if own else self._task.panel
        self._evidence = self.decider.evidence if own else self._task.evidence
        self.length = self._task.length(env.options)

    @property
    def history(self) -> History:
        """The running episode."""
        assert self.env.history is not None
        return self.env.history

    @property
    def done(self) -> int:
        """Progress of the running episode: number of decisions or of statements."""
        return self._task.done(self.history)

    def renderer(self, human: bool) -> Renderer:
        """Return a renderer with the evidence of the decider, of a window if `human`."""
        return Renderer(self.env.options, human, self.panel)

    def play(self, seed: int, on_step: Callable[[], None]) -> Iterator[History]:
        """Play an episode; yield its history before every step, with the evidence of the decider.

        Args:
            seed: of the episode.
            on_step: called after every step.
        """
        env = self.env
        observe = getattr(self.decider, "observe", None)
        observation, _ = env.reset(seed=seed)
        start, state, terminated = np.ones(1, np.bool_), None, False
        while not terminated:
            rows = observation[None] if observe is None else observe(env.world)
            self.history.set_evidence(self._evidence(rows, state, start)[0])
            actions, state = self.decider.predict(rows, state, start, deterministic=True)
            yield self.history
            start = np.zeros(1, np.bool_)
            observation, _, terminated, _, _ = env.step(int(actions[0]))
            on_step()

    def table(self, title: str) -> Table:
        """Return a table of the episode that has just ended."""
        table = Table(title=escape(title), title_justify="left", caption_justify="left")
        self._task.fill(table, self.history, self.env.options)
        return table


def _fill_decisions(table: Table, history: History, options: ModelOptions) -> None:
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


def _fill_statements(table: Table, history: History, options: QuickestOptions) -> None:
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


DECISIONS = Task(
    default="ate",
    load=load_decider,
    panel=posterior_panel("Kalman filters"),
    evidence=lambda rows, state, start: bank_posterior(rows),
    length=lambda options: options.segments,
    done=lambda history: len(history.decisions),
    fill=_fill_decisions,
)
"""The decider waits, or declares a mode of a segment."""

STATEMENTS = Task(
    default="threshold",
    load=lambda name, options: statement_decider(name, options)[2],
    panel=probability_panel("bank"),
    evidence=lambda rows, state, start: bank_probabilities(rows),
    length=lambda options: options.ticks,
    done=lambda history: len(history.trace),
    fill=_fill_statements,
)
"""The decider states the present mode at every tick."""
