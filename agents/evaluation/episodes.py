"""An episode that was played: its table, and its picture beside that of other deciders."""

from itertools import pairwise
from typing import Any

import numpy as np
from rich.table import Table
from scipy.special import softmax

from agents.evaluation.cells import filled_table
from agents.evaluation.task import Task
from agents.figures.tracks import UNDECIDED
from agents.interface.output_files import finite
from baselines.scoring.statements import Statements, measure_statements
from hybrid_env.checks import FloatArray
from hybrid_env.rendering.evidence import mode_name
from hybrid_env.rendering.history import History


def episode_table(task: Task, title: str, history: History) -> Table:
    """Return a table of an episode that has just ended, with one row for each segment."""
    announced = task.waits
    decisions = timeline(task, history)
    decided = decisions["modes"] != UNDECIDED if announced else decisions["right"]
    bounds = [*history.switches.tolist(), len(history.stated)]
    rows = []
    for number, (first, end) in enumerate(pairwise(bounds)):
        mode = history.decisions[number].mode if announced else history.stated[end - 1]
        modes = (
            mode_name(int(each), task.options.all_modes)
            for each in (history.true_modes[first], mode)
        )
        verdict = "[green]correct[/]" if decisions["right"][end - 1] else "[red]wrong[/]"
        until = str(decided[first:end].argmax()) if decided[first:end].any() else "all"
        rows.append((str(number + 1), *modes, verdict, f"{until} of {end - first}"))
    words = (
        ("decided", "undecided", "") if announced else ("last", "not right", decisions["summary"])
    )
    heads = ("segment", "true mode", f"{words[0]} mode", "decision", f"ticks\n{words[1]}")
    return filled_table(title, heads, rows, words[2], texts=4)


def timeline(task: Task, history: History) -> dict[str, Any]:
    """Return what was declared or stated in an episode: attributes of `TrackRecord`."""
    return (_declared if task.waits else _stated)(task, history)


def page_data(task: Task, history: History, rewards: FloatArray) -> dict[str, Any]:
    """Return what the page of an episode shows of a decider, as lists: modes, outcomes, delays so
    far, rewards so far, estimates and posteriors of every tick, and the ticks of the decisions.
    """
    decisions = timeline(task, history)
    modes, marks, decided = decisions["modes"], decisions["marks"], decisions["right"]
    evidence = history.evidence.T
    if task.waits:
        decided = modes != UNDECIDED
        # A declaration is shown at its tick.
        modes[marks] = [decision.mode for decision in history.decisions]
        evidence = softmax(evidence, axis=0)
    segments = np.split(decided, history.switches[1:])
    delays = [np.cumsum(~np.logical_or.accumulate(segment)) for segment in segments]
    arrays = {
        "modes": modes,
        "right": decisions["right"],
        "delays": np.concatenate(delays),
        "rewards": np.cumsum(rewards),
        "estimates": history.points("estimate_").T,
        "posteriors": evidence.round(4),
        "marks": marks,
    }
    return {name: finite(array) for name, array in arrays.items()}


def _declared(task: Task, history: History) -> dict[str, Any]:
    """Return the declarations: statements from their tick to the end of the segment."""
    lengths, ticks, correct = (
        np.array([getattr(decision, key) for decision in history.decisions])
        for key in ("length", "ticks", "correct")
    )
    switches = np.cumsum(lengths) - lengths
    since = np.arange(len(history.stated)) - np.repeat(switches, lengths)
    rewards = task.options.segment_reward(correct, ticks)
    return {
        "modes": np.where(since < np.repeat(ticks, lengths), UNDECIDED, history.stated),
        "switches": switches,
        "right": np.repeat(correct, lengths),
        "marks": switches + ticks - 1,
        "summary": f"{rewards.mean():+.2f}",
    }


def _stated(task: Task, history: History) -> dict[str, Any]:
    """Return the statements."""
    stated, true = history.stated, history.true_modes
    metrics = measure_statements(
        Statements(true[:, None], stated[:, None]), task.options.change_cost
    )
    delay = metrics.value("delay")
    delayed = "no switch detected" if np.isnan(delay) else f"mean delay {delay:.1f} ticks"
    wrong = round(1e-3 * len(stated) * float(metrics.wrong_changes[0]))
    words = (
        f"{100 * metrics.right[0]:.1f} % of the ticks right",
        delayed,
        f"{wrong} changes to a wrong mode",
        f"mean reward {metrics.reward[0]:.3f}",
    )
    return {
        "modes": stated,
        "right": true == stated,
        "switches": np.zeros(0, np.int64),
        "marks": np.flatnonzero(np.diff(stated, prepend=stated[:1])),
        "summary": ", ".join(words),
    }
