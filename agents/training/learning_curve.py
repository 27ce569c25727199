"""The learning curve: periodic evaluation of an agent during training, on episodes reserved for
it.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from agents.evaluation.task import sweep, task_of
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import decider_style
from agents.interface.output_files import save_figure
from agents.training.run_folder import read_metrics
from baselines.rules import seeds
from baselines.rules.decider import Decider, rules


@dataclass(eq=False)
class LearningCurve:
    """Evaluates an agent at its default threshold, at geometrically spaced steps, next to a
    classical rule.

    The rule has its best threshold, chosen on the same episodes.
    """

    # What a mean reward is the mean of.
    unit: str
    # Name of the rule.
    rule: str
    # What is evaluated, in words.
    sample: str
    # Returns `reward` and other metrics of an agent.
    measure: Callable[[Decider], Mapping[str, float]]
    # Returns the mean reward of the rule.
    measure_rule: Callable[[], float]
    # Environment steps up to the first evaluation, 2 to 5 s of training.
    first: ClassVar[float] = 100_000.0
    # Of an environment.
    episodes: ClassVar[int] = 200

    def __post_init__(self) -> None:
        self._next = self.first

    @functools.cached_property
    def reference_reward(self) -> float:
        """Mean reward of the classical rule at its best threshold, on the same episodes."""
        return self.measure_rule()

    def due(self, steps: int) -> bool:
        """Whether an evaluation is due after a number of environment steps."""
        return steps >= self._next

    def skip(self, steps: int) -> None:
        """Skip the evaluations that were due up to a number of environment steps."""
        while self._next <= steps:
            self._next *= 1.4

    def evaluate(self, decider: Decider, steps: int, seconds: float) -> dict[str, float]:
        """Return the training time so far, the metrics of the agent, and the reward of the
        classical rule.
        """
        self.skip(steps)
        measured = dict(self.measure(decider)) | {"reference": self.reference_reward}
        return {"seconds": seconds} | {f"evaluation/{name}": measured[name] for name in measured}

    def summary(self, metrics: Sequence[dict[str, Any]]) -> list[str]:
        """Return the lines printed after training: final metrics, and when the agent surpassed
        the rule.
        """
        points = learning_points(metrics)
        if not points:
            return []
        last = dict(points[-1])
        reward, reference = (last.pop(f"evaluation/{name}") for name in ("reward", "reference"))
        others = ", ".join(
            f"{name.removeprefix('evaluation/').replace('_', ' ')} {value:.4g}"
            for name, value in last.items()
            if name.startswith("evaluation/")
        )
        lines = [
            f"Reward {reward:.3f} per {self.unit}, {others}, "
            f"after {last['seconds']:.0f} s of training ({self.sample})"
        ]
        best = f"Best reward of {self.rule}"
        for row in points:
            if row["evaluation/reward"] > row["evaluation/reference"]:
                when = f"after {row['seconds']:.0f} s and {row['step']:,} steps"
                return [*lines, f"{best} surpassed: {reference:.3f}, {when}"]
        return [*lines, f"{best} not surpassed: {reference:.3f}"]


def environment_curve(env_id: str, options: Mapping[str, Any]) -> LearningCurve:
    """Return the learning curve of an agent in an environment with options that override those
    of its id.
    """
    task = task_of(env_id, options)
    episodes = LearningCurve.episodes
    rule = rules(task.switches)[task.reference].create(task.options)
    shown = "accuracy", "ticks", "right", "wrong_changes"
    measured = [metric.name for metric in task.metrics if metric.name in shown]

    def measure(agent: Decider) -> dict[str, float]:
        scores = sweep(task, agent, episodes, seeds.LEARNING_CURVE, thresholds=(agent.default,))
        names = ("reward", *measured)
        return {name: float(scores.curve(task.statistic(name))[0]) for name in names}

    def measure_rule() -> float:
        scores = sweep(task, rule, episodes, seeds.LEARNING_CURVE)
        return float(scores.curve(task.statistic("reward")).max())

    sample = f"{episodes} episodes"
    return LearningCurve(task.unit, rule.title, sample, measure, measure_rule)


def learning_points(metrics: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the lines of a run's metrics that `LearningCurve.evaluate` wrote."""
    return [row for row in metrics if "evaluation/reward" in row]


def draw_learning_curve(folder: Path, path: Path, curve: LearningCurve) -> None:
    """Write the mean reward of a run folder against training time and environment steps as PNG.

    A dashed line is the classical rule of the learning curve at its best threshold.
    """
    points = learning_points(read_metrics(folder))
    columns = {
        "training time, s": [row["seconds"] for row in points],
        "environment steps, millions": [row["step"] / 1e6 for row in points],
    }
    panels = []
    for label, values in columns.items():
        end = 1.05 * max(values, default=1.0)
        curves = (
            []
            if not points
            else [
                Curve(
                    folder.name,
                    decider_style(folder.name),
                    values,
                    [row["evaluation/reward"] for row in points],
                    size=3.5,
                ),
                Curve(
                    f"{curve.rule} at its best threshold",
                    decider_style(curve.rule),
                    [1e-3 * end, 0.999 * end],
                    [points[-1]["evaluation/reference"]] * 2,
                    size=0.0,
                    dashes="--",
                ),
            ]
        )
        axis = Axis(f"mean reward per {curve.unit}")
        panels.append(Panel("", Axis(label, (0.0, end)), axis, curves))
    save_figure(curve_figure([panels], (10.0, 4.0), sharey=True), path)
