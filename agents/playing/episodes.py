"""Episodes of a decider on one track: of announced segments, or with unknown switch moments."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from agents.evaluation.deciders import load_decider
from agents.evaluation.statement_deciders import statement_decider
from agents.playing.evidence import DeciderEvidence, decider_evidence
from agents.playing.statement_evidence import statement_evidence
from baselines.rules.metrics import measure_statements
from baselines.rules.statements import Statements
from hybrid_env.env import HybridTrackEnv
from hybrid_env.quickest_env import HybridTrackQuickestEnv
from hybrid_env.rendering.figure import Renderer
from hybrid_env.rendering.modes import mode_name
from hybrid_env.rendering.quickest_figure import QuickestRenderer
from hybrid_env.rendering.quickest_history import ACTIVE
from hybrid_env.worlds.track_env import TrackEnv


class Episodes(ABC):
    """Episodes of a decider on one track.

    Args:
        env: environment with a render mode.
        name: of the decider.

    Attributes:
        env, name: as given.
        decider: the decider.
        evidence: what it compares with its threshold.
        length: of an episode, in units of `done`.

    Raises:
        ArgumentError: the decider is unknown, or not for this environment.
    """

    decider: Any
    evidence: DeciderEvidence
    length: int

    def __init__(self, env: TrackEnv, name: str):
        self.env, self.name = env, name

    @property
    @abstractmethod
    def done(self) -> int:
        """Progress of the running episode."""

    @abstractmethod
    def renderer(self, human: bool) -> Renderer:
        """Return a renderer, of a window if `human`."""

    @abstractmethod
    def table(self, title: str) -> Table:
        """Return a table of the episode that has just ended."""

    def play(self, seed: int, on_step: Callable[[], None]) -> Iterator[Any]:
        """Play an episode; yield its history before every step, with the evidence of the decider.

        Args:
            seed: of the episode.
            on_step: called after every step.
        """
        env, history = self.env, self.env.history
        observe = getattr(self.decider, "observe", None)
        observation, _ = env.reset(seed=seed)
        start, state, terminated = np.ones(1, np.bool_), None, False
        while not terminated:
            rows = observation[None] if observe is None else observe(env.world)
            history.set_evidence(self.evidence.compute(rows, state, start)[0])
            actions, state = self.decider.predict(rows, state, start, deterministic=True)
            yield history
            start = np.zeros(1, np.bool_)
            observation, _, terminated, _, _ = env.step(int(actions[0]))
            on_step()


class DecisionEpisodes(Episodes):
    """Episodes in which the decider waits, or declares a mode of a segment; see `Episodes`."""

    def __init__(self, env: HybridTrackEnv, name: str):
        super().__init__(env, name)
        self.decider = load_decider(name, env.options)
        self.evidence = decider_evidence(self.decider)
        self.length = env.options.segments

    @property
    def done(self) -> int:
        """Number of decisions."""
        return len(self.env.history.decisions)

    def renderer(self, human: bool) -> Renderer:
        """See `Episodes.renderer`."""
        return Renderer(self.env.options, human, self.evidence.panel)

    def table(self, title: str) -> Table:
        """Return a table with one row for each decision."""
        radii = self.env.options.radii
        table = Table(title=escape(title), title_justify="left")
        for name in ("segment", "true mode", "decided mode", "decision"):
            table.add_column(name)
        table.add_column("ticks", justify="right")
        for number, decision in enumerate(self.env.history.decisions, start=1):
            verdict = "[green]correct[/]" if decision.correct else "[red]wrong[/]"
            table.add_row(
                str(number),
                mode_name(decision.true_mode, radii),
                mode_name(decision.mode, radii),
                verdict + (", forced" if decision.forced else ""),
                f"{decision.ticks} of {decision.length}",
            )
        return table


class StatementEpisodes(Episodes):
    """Episodes in which the decider states the present mode at every tick; see `Episodes`."""

    def __init__(self, env: HybridTrackQuickestEnv, name: str):
        super().__init__(env, name)
        *_, self.decider = statement_decider(name, env.options)
        self.evidence = statement_evidence(self.decider)
        self.length = env.options.ticks

    @property
    def done(self) -> int:
        """Number of statements."""
        return len(self.env.history.trace)

    def renderer(self, human: bool) -> QuickestRenderer:
        """See `Episodes.renderer`."""
        return QuickestRenderer(self.env.options, human, self.evidence.panel)

    def table(self, title: str) -> Table:
        """Return a table with one row for each segment, and metrics of the episode."""
        history, options = self.env.history, self.env.options
        true, stated = history.true_modes, history.trace[:, ACTIVE].astype(np.int64)
        right = true == stated
        wrong = (np.diff(stated, prepend=stated[:1]) != 0) & ~right
        metrics = measure_statements(Statements(true[:, None], stated[:, None]), options.change_cost)
        table = Table(
            title=escape(title),
            title_justify="left",
            caption=f"right {metrics.right[0]:.1%}, reward {metrics.reward[0]:.3f} per tick",
            caption_justify="left",
        )
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
        return table
