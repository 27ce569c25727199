"""The learning curve: periodic evaluation of an agent during training, on episodes reserved for
it.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.evaluation.task import sweep
from agents.evaluation.tasks import task_of
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import decider_style
from agents.interface.output_files import save_figure
from agents.training.run_folder import read_metrics
from baselines.rules import seeds
from baselines.rules.decider import Decider, rules

EPISODES = 200
PREFIX = "evaluation/"
REWARD_KEY = PREFIX + "reward"
# Of the classical rule.
REFERENCE_KEY = PREFIX + "reference"
# Environment steps, 2 to 5 s of training.
FIRST_EVALUATION = 100_000


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
    # Returns `reward` and other metrics, without prefix, of an agent.
    measure: Callable[[Decider], Mapping[str, float]]
    # Returns the mean reward of the rule.
    measure_rule: Callable[[], float]

    def __post_init__(self) -> None:
        self._next = float(FIRST_EVALUATION)

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
        measured = {PREFIX + name: value for name, value in self.measure(decider).items()}
        return {"seconds": seconds} | measured | {REFERENCE_KEY: self.reference_reward}

    def summary(self, metrics: Sequence[dict[str, Any]]) -> list[str]:
        """Return the lines printed after training: final metrics, and when the agent surpassed
        the rule.
        """
        points = learning_points(metrics)
        if not points:
            return []
        last = points[-1]
        others = ", ".join(
            f"{name.removeprefix(PREFIX).replace('_', ' ')} {value:.4g}"
            for name, value in last.items()
            if name.startswith(PREFIX) and name not in (REWARD_KEY, REFERENCE_KEY)
        )
        lines = [
            f"Reward {last[REWARD_KEY]:.3f} per {self.unit}, {others}, "
            f"after {last['seconds']:.0f} s of training ({self.sample})"
        ]
        best = f"Best reward of {self.rule}"
        surpassed = next((row for row in points if row[REWARD_KEY] > row[REFERENCE_KEY]), None)
        if surpassed is None:
            return [*lines, f"{best} not surpassed: {last[REFERENCE_KEY]:.3f}"]
        when = f"after {surpassed['seconds']:.0f} s and {surpassed['step']:,} steps"
        return [*lines, f"{best} surpassed: {last[REFERENCE_KEY]:.3f}, {when}"]


def environment_curve(env_id: str, options: Mapping[str, Any]) -> LearningCurve:
    """Return the learning curve of an agent in an environment with options that override those
    of its id.
    """
    task = task_of(env_id, options)
    rule = rules(task.switches)[task.reference].create(task.options)
    shown = "accuracy", "ticks", "right", "wrong_changes"
    measured = [metric.name for metric in task.metrics if metric.name in shown]

    def measure(agent: Decider) -> dict[str, float]:
        scores = sweep(task, agent, EPISODES, seeds.LEARNING_CURVE, thresholds=(agent.default,))
        names = ("reward", *measured)
        return {name: float(scores.curve(task.statistic(name))[0]) for name in names}

    def measure_rule() -> float:
        scores = sweep(task, rule, EPISODES, seeds.LEARNING_CURVE)
        return float(scores.curve(task.statistic("reward")).max())

    sample = f"{EPISODES} episodes"
    return LearningCurve(task.unit, rule.title, sample, measure, measure_rule)


def learning_points(metrics: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the lines of a run's metrics that `LearningCurve.evaluate` wrote."""
    return [row for row in metrics if REWARD_KEY in row]


def draw_learning_curve(folder: Path, path: Path, curve: LearningCurve) -> None:
    """Write the mean reward of a run folder against training time and environment steps as PNG.

    A dashed line is the classical rule of the learning curve at its best threshold.
    """
    points = learning_points(read_metrics(folder))
    rewards = [row[REWARD_KEY] for row in points]
    columns = {
        "training time, s": [row["seconds"] for row in points],
        "environment steps, millions": [row["step"] / 1e6 for row in points],
    }
    panels = []
    for label, values in columns.items():
        curves = []
        limits = None
        if points:
            level = points[-1][REFERENCE_KEY]
            end = 1.05 * max(values)
            limits = (0.0, end)
            curves = [
                Curve(
                    folder.name,
                    decider_style(folder.name),
                    values,
                    rewards,
                    size=3.5,
                    filled=True,
                ),
                Curve(
                    f"{curve.rule} at its best threshold",
                    decider_style(curve.rule),
                    [1e-3 * end, 0.999 * end],
                    [level] * 2,
                    size=0.0,
                    dashes="--",
                ),
            ]
        panels.append(Panel("", Axis(label, limits), Axis(f"mean reward per {curve.unit}"), curves))
    save_figure(curve_figure([panels], (10.0, 4.0), sharey=True), path)
