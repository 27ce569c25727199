"""The learning curve: periodic evaluation of an agent during training, on episodes reserved for
it.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.evaluation.task import Wording, sweep
from agents.evaluation.tasks import task_of
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import decider_style
from agents.interface.output_files import save_figure
from agents.training.run_folder import read_metrics
from baselines.rules import seeds
from baselines.rules.decider import DeciderFamily, rules

EPISODES = 200
PREFIX = "evaluation/"
REWARD_KEY = PREFIX + "reward"
# Environment steps, 2 to 5 s of training.
FIRST_EVALUATION = 100_000
# Ratio of the steps of consecutive evaluations.
EVALUATION_SPACING = 1.4


@dataclass(eq=False)
class LearningCurve:
    """Evaluates an agent at its default threshold, at geometrically spaced steps, next to a
    classical rule.

    The rule has its best threshold, chosen on the same episodes.
    """

    # Names and units.
    wording: Wording
    # What is evaluated, in words.
    sample: str
    # Returns `reward` and the other metrics of the wording, without prefix, of an agent.
    measure: Callable[[DeciderFamily], Mapping[str, float]]
    # Returns the mean reward of the rule.
    measure_rule: Callable[[], float]

    def __post_init__(self) -> None:
        self._next = float(FIRST_EVALUATION)

    @property
    def reference_key(self) -> str:
        """Key of the reward of the classical rule in the metrics."""
        return PREFIX + self.wording.key

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
            self._next *= EVALUATION_SPACING

    def evaluate(self, family: DeciderFamily, steps: int, seconds: float) -> dict[str, float]:
        """Return the training time so far, the metrics of the agent, and the reward of the
        classical rule.
        """
        self.skip(steps)
        measured = {PREFIX + name: value for name, value in self.measure(family).items()}
        return {"seconds": seconds} | measured | {self.reference_key: self.reference_reward}

    def summary(self, metrics: Sequence[dict[str, Any]]) -> list[str]:
        """Return the lines printed after training: final metrics, and when the agent surpassed
        the rule.
        """
        points = learning_points(metrics)
        if not points:
            return []
        last = points[-1]
        other = self.wording.text.format(
            **{name: last[PREFIX + name] for name in self.wording.measured}
        )
        lines = [
            f"Reward {last[REWARD_KEY]:.3f} per {self.wording.unit}, {other}, "
            f"after {last['seconds']:.0f} s of training ({self.sample})"
        ]
        best = f"Best reward of the {self.wording.sentence}"
        surpassed = next((row for row in points if row[REWARD_KEY] > row[self.reference_key]), None)
        if surpassed is None:
            return [*lines, f"{best} not surpassed: {last[self.reference_key]:.3f}"]
        when = f"after {surpassed['seconds']:.0f} s and {surpassed['step']:,} steps"
        return [*lines, f"{best} surpassed: {last[self.reference_key]:.3f}, {when}"]


def environment_curve(env_id: str, options: Mapping[str, Any]) -> LearningCurve:
    """Return the learning curve of an agent in an environment with options that override those
    of its id.
    """
    task = task_of(env_id, options)
    wording = task.wording

    def measure(family: DeciderFamily) -> dict[str, float]:
        scores = sweep(task, family, EPISODES, seeds.LEARNING_CURVE, thresholds=(family.default,))
        names = ("reward", *wording.measured)
        return {name: float(scores.curve(task.statistic(name))[0]) for name in names}

    def measure_rule() -> float:
        family = rules(task.switches)[task.reference].family(task.options)
        scores = sweep(task, family, EPISODES, seeds.LEARNING_CURVE)
        return float(scores.curve(task.statistic("reward")).max())

    return LearningCurve(wording, f"{EPISODES} episodes", measure, measure_rule)


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
            level = points[-1][curve.reference_key]
            end = 1.05 * max(values)
            limits, rule = (0.0, end), curve.wording.rule
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
                    f"{rule} at its best threshold",
                    decider_style(rule),
                    [1e-3 * end, 0.999 * end],
                    [level] * 2,
                    size=0.0,
                    dashes="--",
                ),
            ]
        panels.append(
            Panel("", Axis(label, limits), Axis(f"mean reward per {curve.wording.unit}"), curves)
        )
    save_figure(curve_figure([panels], (10.0, 4.0), sharey=True), path)
