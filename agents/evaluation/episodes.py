"""Episodes of a decider on one track: playing them, their table, and their page."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from rich.table import Table
from scipy.special import softmax

from agents.evaluation.cells import filled_table
from agents.evaluation.registry import find_decider, load_decider
from agents.evaluation.task import Task
from agents.interface.output_files import finite
from baselines.rules.rollout import rollout
from baselines.scoring.statements import Statements, measure_statements
from baselines.scoring.timelines import NO_MODE
from hybrid_env.registration import make_track_vector_env
from hybrid_env.rendering.evidence import mode_name
from hybrid_env.rendering.history import History


class Episodes:
    """Episodes of a decider on one track. `of_filters` keeps the evidence of the filters in the
    history, in place of what the decider compares with its threshold.
    """

    def __init__(self, task: Task, name: str, of_filters: bool = False):
        changes = dict(find_decider(name, task.options).options)
        if getattr(task.options, "actions", "all") == "types":
            # Deciders declare hypotheses.
            changes["actions"] = "all"
        self.task, self.name = task.changed(changes), name
        given = {"render_mode": "rgb_array", **self.task.given}
        options = make_track_vector_env(task.env_id, 1, **given).options
        self.decider = load_decider(name, options)
        # Between decisions that the environment does not ask for.
        self.every = options.decide_every if self.decider.every_tick else 1
        if self.every > 1:
            given["decide_every"] = 1
        self.env = make_track_vector_env(task.env_id, 1, **given)
        self.of_filters = of_filters
        # The running episode.
        self.history = History(self.env.options, self.decider.panel())
        self.env.histories[0] = self.history
        # Its steps: rows of the history, and rewards.
        self.rewards: list[tuple[int, float]] = []

    def play(self, seed: int) -> Iterator[History]:
        """Play an episode; yield its history before every step, with the evidence of the
        decider.
        """
        self.rewards = []
        row = 0
        for now in rollout(self.env, self.decider, seed, decide_every=self.every):
            if now.step:
                self.rewards.append((row, float(now.rewards[0])))
            if now.terminated[0]:
                return
            row = len(self.history.trace) - 1
            if not self.of_filters:
                evidence = self.decider.evidence(now.seen, now.state, now.starts)
                self.history.set_evidence(evidence[0])
            yield self.history

    def page_data(self) -> dict[str, Any]:
        """Return what a page shows of the episode that was played last, as lists: modes, outcomes,
        delays so far, rewards so far, estimates and posteriors of every tick, those that are drawn,
        and the ticks of the decisions.
        """
        history = self.history
        rows, rewards = zip(*self.rewards, strict=True)
        earned = np.zeros(len(history.trace))
        earned[list(rows)] = rewards
        decisions = timeline(self.task, history)
        modes, marks, decided = decisions["modes"], decisions["marks"], decisions["right"]
        evidence = history.evidence.T
        if self.task.waits:
            decided = modes != NO_MODE
            # A declaration is shown at its tick.
            modes[marks] = [decision["decided_mode"] for decision in history.decisions]
            evidence = softmax(evidence, axis=0)
        segments = np.split(decided, history.switches[1:])
        delays = [np.cumsum(~np.logical_or.accumulate(segment)) for segment in segments]
        arrays = {
            "modes": modes,
            "right": decisions["right"],
            "delays": np.concatenate(delays),
            "rewards": np.cumsum(earned),
            "estimates": history.points("estimate_").T,
            "posteriors": evidence.round(4),
            "drawn": history.drawn,
            "marks": marks,
        }
        return {"name": self.name, **{name: finite(array) for name, array in arrays.items()}}


def episode_table(task: Task, title: str, history: History) -> Table:
    """Return a table of an episode that has just ended, with one row for each segment."""
    announced = task.waits
    decisions = timeline(task, history)
    decided = decisions["modes"] != NO_MODE if announced else decisions["right"]
    bounds = [*history.switches.tolist(), len(history.stated)]
    rows = []
    for number, (first, end) in enumerate(pairwise(bounds)):
        mode = history.decisions[number]["decided_mode"] if announced else history.stated[end - 1]
        modes = (
            mode_name(int(each), task.options.all_modes)
            for each in (history.true_modes[first], mode)
        )
        verdict = "[green]correct[/]" if decisions["right"][end - 1] else "[red]wrong[/]"
        until = str(decided[first:end].argmax()) if decided[first:end].any() else "all"
        rows.append((str(number + 1), *modes, verdict, f"{until} of {end - first}"))
    words = ("decided", "undecided") if announced else ("last", "not right")
    heads = ("segment", "true mode", f"{words[0]} mode", "decision", f"ticks\n{words[1]}")
    return filled_table(title, heads, rows, decisions["summary"], texts=4)


def timeline(task: Task, history: History) -> dict[str, Any]:
    """Return what was declared or stated in an episode of T ticks: `modes` (T,), `NO_MODE` before
    a declaration; whether they are `right` (T,); the ticks `marks` at which a mode is declared, or
    the statement changes; a `summary` of statements.
    """
    if task.waits:
        lengths, ticks, correct = (
            np.array([decision[key] for decision in history.decisions])
            for key in ("decided_length", "ticks", "correct")
        )
        switches = np.cumsum(lengths) - lengths
        since = np.arange(len(history.stated)) - np.repeat(switches, lengths)
        return {
            # A declaration holds from its tick to the end of the segment.
            "modes": np.where(since < np.repeat(ticks, lengths), NO_MODE, history.stated),
            "right": np.repeat(correct, lengths),
            "marks": switches + ticks - 1,
            "summary": "",
        }
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
        "marks": np.flatnonzero(np.diff(stated, prepend=stated[:1])),
        "summary": ", ".join(words),
    }
