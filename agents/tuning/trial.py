"""One trial: a training that ends early if it is worse than the trials before it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from agents.training.learning_curve import REWARD_KEY
from agents.training.recipe import Recipe
from agents.training.run import TrainingProgress
from agents.training.runs import make_run
from hybrid_env.checks import ArgumentError

POINTS = 20  # of the reward during a training
FIRST_POINT = 5  # points before a training may end


@dataclass(frozen=True)
class Outcome:
    """Result of a trial.

    Attributes:
        rewards: mean reward of recent segments or ticks in training, at up to `POINTS` equal parts of it.
        reward: of the trained agent on the episodes of the learning curve; None if the training ended early.
        error: why it could not be trained, "" if it could.
    """

    rewards: tuple[float, ...]
    reward: float | None
    error: str = ""


class _EndedEarlyError(Exception):
    """The training is worse than half of the trials before it."""


def train_trial(
    env_id: str,
    options: dict[str, Any],
    recipe: Recipe,
    seed: int,
    steps: int | None,
    medians: Sequence[float],
) -> Outcome:
    """Train an agent without a folder and evaluate it.

    Args:
        env_id, options, recipe, seed, steps: of the training, see `make_run`.
        medians: median rewards of earlier trials at each point; the training ends at a point at which its
            best reward so far is smaller. Empty if there are too few trials.
    """
    rewards: list[float] = []

    def check(now: TrainingProgress) -> None:
        reached = min(POINTS, POINTS * now.steps // now.total)
        while len(rewards) < reached:
            rewards.append(now.reward)
            known = [reward for reward in rewards if not math.isnan(reward)]
            point = len(rewards)
            if medians and FIRST_POINT <= point < POINTS and known and max(known) < medians[point - 1]:
                raise _EndedEarlyError

    try:
        run = make_run(env_id, options, recipe, seed, steps=steps)
        run.train(check)
    except _EndedEarlyError:
        return Outcome(tuple(rewards), None)
    except ArgumentError as error:  # values that do not go together, or a training that has diverged
        return Outcome(tuple(rewards), None, str(error))
    found = run.curve.evaluate(run.family(""), run.num_timesteps, 0.0)
    return Outcome(tuple(rewards), float(found[REWARD_KEY]))
