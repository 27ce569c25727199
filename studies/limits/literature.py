"""Published rules on equal terms: each with all its thresholds tuned, with P := I at every switch
and with the covariance of the estimate kept.
"""

from dataclasses import dataclass

import numpy as np

from agents import find_decider, sweep, task_of
from baselines import Scores
from studies.limits.study import SELECTION, THREE, Row, step_rows

# Values of alpha and beta of which every pair is tried.
ALPHAS = (
    0.3,
    0.15,
    0.1,
    0.05,
    0.03,
    0.015,
    5e-3,
    1e-3,
    3e-4,
    1e-4,
    3e-5,
    1e-6,
    1e-8,
    1e-10,
    1e-13,
    1e-17,
)
BETAS = (0.3, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6)


@dataclass(frozen=True)
class Published:
    """A rule as it is compared."""

    title: str
    # Name of the decider.
    name: str
    # Whether both thresholds are tuned, or the second one equals the first.
    apart: bool = False
    # Whether the environment starts the filters from P := I at every switch.
    reset: bool = True


RULES = (
    Published("ATE, alpha = beta", "ate"),
    Published("ATE, alpha and beta apart", "ate", apart=True),
    Published("gap rule", "gap"),
    Published("MSPRT", "msprt"),
    Published("ATE, alpha = beta, P kept", "ate", reset=False),
    Published("ATE, alpha and beta apart, P kept", "ate", apart=True, reset=False),
    Published("gap rule, P kept", "gap", reset=False),
    Published("MSPRT, P kept", "msprt", reset=False),
    # It filters the measurements of the published rows again.
    Published("MSPRT, P kept, from the published rows", "msprt-kept"),
)


def published_rules(noise: float, episodes: int, seed: int) -> list[Row]:
    """Return a row of each of `RULES` at a noise level, whose gain is that over the first one.

    The thresholds are the pair with the largest mean reward on a third as many other episodes.
    """
    selection = max(episodes // 3, 50)
    steps: dict[str, Scores] = {}
    thresholds = []
    for rule in RULES:
        given = {"measurement_variance": noise, "reset_covariance": rule.reset}
        task = task_of(THREE, given)
        decider = find_decider(rule.name, task.options)
        alphas = ALPHAS if rule.apart else decider.thresholds
        tried = [decider.changed(beta=beta) for beta in BETAS] if rule.apart else [decider]
        reward = task.statistic("reward")
        earned = [
            sweep(task, each, selection, SELECTION, thresholds=alphas).curve(reward)
            for each in tried
        ]
        second, k = np.unravel_index(np.argmax(earned), np.shape(earned))
        threshold = alphas[k]
        steps[rule.title] = sweep(task, tried[second], episodes, seed, thresholds=(threshold,))
        thresholds.append([threshold, BETAS[second]] if rule.apart else [threshold])
    first = next(iter(steps.values()))
    compared = [None, *[first] * (len(steps) - 1)]
    rows = step_rows(task, THREE, noise, steps, compared)
    return [row | {"thresholds": used} for row, used in zip(rows, thresholds, strict=True)]
