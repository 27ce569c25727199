"""An episode that was played: its table, and its picture beside that of other deciders."""

from itertools import pairwise
from typing import Any

import numpy as np
from rich.table import Table

from agents.evaluation.cells import filled_table
from agents.evaluation.task import Task
from agents.figures.tracks import UNDECIDED, TrackRecord
from baselines.rules.decider import ANNOUNCED
from baselines.scoring.statements import StatementMetrics, Statements, measure_statements
from hybrid_env.rendering.evidence import mode_name
from hybrid_env.rendering.history import History


def episode_table(task: Task, title: str, history: History) -> Table:
    """Return a table of an episode that has just ended."""
    make = _decisions if task.switches == ANNOUNCED else _segments
    return make(task, title, history)


def track_record(task: Task, history: History, **common: Any) -> TrackRecord:
    """Return what was declared or stated in an episode, for a figure; `common` has the other
    attributes.
    """
    make = _declared if task.switches == ANNOUNCED else _stated
    return make(task, history, **common)


def _decisions(task: Task, title: str, history: History) -> Table:
    """Return one row for each decision."""
    rows = []
    for number, decision in enumerate(history.decisions, start=1):
        modes = (
            mode_name(mode, task.options.radii) for mode in (decision.true_mode, decision.mode)
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


def _segments(task: Task, title: str, history: History) -> Table:
    """Return one row for each segment, and metrics of the episode."""
    true, stated, rows = history.true_modes, history.stated, []
    right = true == stated
    wrong = (np.diff(stated, prepend=stated[:1]) != 0) & ~right
    bounds = [*history.switches.tolist(), len(true)]
    for number, (first, end) in enumerate(pairwise(bounds), start=1):
        inside = right[first:end]
        mode = mode_name(int(true[first]), task.options.radii)
        until = str(inside.argmax()) if inside.any() else "[red]never[/]"
        changes = str(wrong[first:end].sum())
        rows.append((str(number), mode, str(end - first), until, f"{inside.mean():.0%}", changes))
    metrics = _of_episode(task, history)
    caption = f"right {metrics.right[0]:.1%}, reward {metrics.reward[0]:.3f} per tick"
    heads = ("segment", "true mode", "ticks", "ticks until stated", "right", "wrong changes")
    return filled_table(title, heads, rows, caption, 2)


def _declared(task: Task, history: History, **common: Any) -> TrackRecord:
    """Return the declarations: statements from their tick to the end of the segment."""
    decisions, stated = history.decisions, history.stated
    lengths, ticks, correct = (
        np.array([getattr(decision, key) for decision in decisions])
        for key in ("length", "ticks", "correct")
    )
    switches = np.cumsum(lengths) - lengths
    since = np.arange(len(stated)) - np.repeat(switches, lengths)
    rewards = np.where(correct, 1.0, -1.0) - task.options.delay_cost * ticks
    return TrackRecord(
        **common,
        modes=np.where(since < np.repeat(ticks, lengths), UNDECIDED, stated),
        switches=switches,
        right=np.repeat(correct, lengths),
        marks=switches + ticks - 1,
        summary=f"{rewards.mean():+.2f}",
    )


def _stated(task: Task, history: History, **common: Any) -> TrackRecord:
    """Return the statements."""
    stated, metrics = history.stated, _of_episode(task, history)
    delay = metrics.value("delay")
    delayed = "no switch detected" if np.isnan(delay) else f"mean delay {delay:.1f} ticks"
    wrong = round(1e-3 * len(stated) * float(metrics.wrong_changes[0]))
    right = f"{100 * metrics.right[0]:.1f} % of the ticks right"
    reward = f"mean reward {metrics.reward[0]:.3f}"
    summary = f"{right}, {delayed}, {wrong} changes to a wrong mode, {reward}"
    return TrackRecord(
        **common,
        modes=stated,
        right=history.true_modes == stated,
        switches=np.zeros(0, np.int64),
        marks=np.flatnonzero(np.diff(stated, prepend=stated[:1])),
        summary=summary,
    )


def _of_episode(task: Task, history: History) -> StatementMetrics:
    statements = Statements(history.true_modes[:, None], history.stated[:, None])
    return measure_statements(statements, task.options.change_cost)
