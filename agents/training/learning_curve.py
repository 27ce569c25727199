"""The learning curve: periodic evaluation of an agent during training, on episodes reserved for
it.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from agents.evaluation.bound import bound_scores
from agents.evaluation.registry import find_decider
from agents.evaluation.task import sweep, task_of
from agents.figures.curves import Curve, draw_panel, panel_figure
from agents.figures.decider_colours import decider_styles
from agents.interface.output_files import save_figure
from agents.training.run_folder import read_metrics
from baselines.rules import seeds
from baselines.rules.decider import Decider


@dataclass(eq=False)
class LearningCurve:
    """Evaluates an agent at its default threshold before the training and after every part of it,
    beside classical rules.
    """

    # What a mean reward is the mean of.
    unit: str
    # What is evaluated, in words.
    sample: str
    # Environment steps between two evaluations.
    every: float
    # Returns `reward` and other metrics of an agent.
    measure: Callable[[Decider], Mapping[str, float]]
    # Returns the mean rewards on the same episodes of rules, each at its best threshold, and of the
    # bound, by name.
    measure_references: Callable[[], Mapping[str, float]]
    # Environment steps of the next evaluation.
    next: float = field(default=0.0, init=False)
    # Episodes of an evaluation.
    episodes: ClassVar[int] = 200

    @functools.cached_property
    def references(self) -> Mapping[str, float]:
        """See `measure_references`."""
        return self.measure_references()

    def due(self, steps: int) -> bool:
        """Whether an evaluation is due after a number of environment steps."""
        return steps >= self.next

    def skip(self, steps: int) -> None:
        """Skip the evaluations that were due up to a number of environment steps."""
        self.next = self.every * (steps // self.every + 1)

    def evaluate(self, decider: Decider, steps: int, seconds: float) -> dict[str, float]:
        """Return the training time so far, and the metrics of the agent."""
        self.skip(steps)
        measured = self.measure(decider)
        return {"seconds": seconds} | {f"evaluation/{name}": measured[name] for name in measured}

    def summary(self, metrics: Sequence[dict[str, Any]]) -> list[str]:
        """Return the lines printed after training: final metrics, and the rewards of rules."""
        points = learning_points(metrics)
        if not points:
            return []
        last = dict(points[-1])
        reward = last.pop("evaluation/reward")
        others = ", ".join(
            f"{name.removeprefix('evaluation/').replace('_', ' ')} {value:.4g}"
            for name, value in last.items()
            if name.startswith("evaluation/")
        )
        rules = ", ".join(f"{name} {value:.3f}" for name, value in self.references.items())
        return [
            f"Reward {reward:.3f} per {self.unit}, {others}, "
            f"after {last['seconds']:.0f} s of training ({self.sample})",
            f"On the same episodes: {rules}",
        ]


def environment_curve(env_id: str, options: Mapping[str, Any], every: float) -> LearningCurve:
    """Return the learning curve of an agent in an environment with options that override those
    of its id, with an evaluation after so many steps.
    """
    task = task_of(env_id, options)
    episodes, reward = LearningCurve.episodes, task.statistic("reward")
    shown = "accuracy", "ticks", "right", "wrong_changes"
    measured = [metric.name for metric in task.metrics if metric.name in shown]

    def measure(agent: Decider) -> dict[str, float]:
        scores = sweep(task, agent, episodes, seeds.LEARNING_CURVE, thresholds=(agent.default,))
        names = ("reward", *measured)
        return {name: float(scores.curve(task.statistic(name))[0]) for name in names}

    def measure_references() -> dict[str, float]:
        deciders = task.deciders if task.waits else (task.reference,)
        rules = [find_decider(name, task.options) for name in deciders]
        every_scores = [sweep(task, rule, episodes, seeds.LEARNING_CURVE) for rule in rules]
        if task.waits:
            every_scores.append(bound_scores(task, episodes, seeds.LEARNING_CURVE))
        return {scores.name: float(scores.curve(reward).max()) for scores in every_scores}

    sample = f"{episodes} episodes"
    return LearningCurve(task.unit, sample, every, measure, measure_references)


def learning_points(metrics: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the lines of a run's metrics that `LearningCurve.evaluate` wrote."""
    return [row for row in metrics if "evaluation/reward" in row]


def draw_learning_curve(folder: Path, path: Path, curve: LearningCurve) -> None:
    """Write the mean reward of a run folder against environment steps as PNG.

    Dashed lines are rules at their best thresholds, and the bound.
    """
    points = learning_points(read_metrics(folder))
    steps = [row["step"] / 1e6 for row in points]
    ends = [0.0, max(steps, default=1.0)]
    styles = decider_styles([folder.name, *curve.references])
    curves = [
        Curve(name, styles[name], ends, [value, value], size=0.0, dashes="--")
        for name, value in curve.references.items()
    ]
    if points:
        rewards = [row["evaluation/reward"] for row in points]
        curves.append(Curve(folder.name, styles[folder.name], steps, rewards))
    canvas, [axes] = panel_figure(1, 3.6)
    labels = {"xlabel": "environment steps, millions", "ylabel": f"mean reward per {curve.unit}"}
    draw_panel(axes, curves, **labels)
    save_figure(canvas, path)
