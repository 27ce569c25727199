"""TEASER, a rule of early classification of time series, on the posterior of the bank.

Schaefer & Leser 2020, "TEASER: early and accurate time series classification". At some checkpoints
a classifier predicts, a one-class test accepts what resembles right predictions, and v equal
accepted predictions in a row are declared. Here every tick is a checkpoint, the bank is the
classifier, and the test is a quantile of the error probability of right predictions; the published
support vector machine would also refuse those that are surer than most.
"""

import functools
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from baselines.rules.decider import Actions, Decider, Observations
from baselines.rules.msprt import By, PosteriorRule, rewarded
from baselines.rules.posterior_paths import PosteriorPaths, simulate_posterior_paths
from baselines.rules.seeds import FITTING
from hybrid_env.checks import BoolArray, FloatArray, check_integer, reject
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions

# Share of the right predictions of a checkpoint that its test accepts; 1 less the published nu.
ACCEPTED = 0.95
# Checkpoints with fewer right predictions have the limit of the last one before.
FEWEST = 100
FITTING_EPISODES = 1000


def accepted_errors(paths: PosteriorPaths) -> FloatArray:
    """Return the largest log error probability that the test of each tick accepts, (T,), from
    simulated segments.
    """
    limits: list[float] = []
    for tick in range(paths.log_error_probability.shape[1]):
        right = paths.correct[:, tick] & (paths.length > tick)
        if right.sum() < FEWEST:
            break
        limits.append(float(np.quantile(paths.log_error_probability[right, tick], ACCEPTED)))
    if not limits:
        raise reject(
            "paths",
            len(paths.length),
            f"at least {FEWEST} right predictions at the first tick",
        )
    return np.array(limits)


class TeaserDecider(PosteriorRule):
    """Declares after some equal predictions in a row that resemble right ones.

    Args:
        limits: (T,) from `accepted_errors`.
        predictions: v, number of equal accepted predictions.
        by: what has to be correct, as in the paths of the limits.
    """

    name = "teaser"
    title = "TEASER"
    symbol = "predictions"
    default = 12
    thresholds: ClassVar[tuple[float, ...]] = (1, 2, 3, 5, 7, 9, 10, 11, 12, 13, 15, 20, 25)

    def __init__(self, limits: FloatArray, predictions: int = 12, by: By = "hypothesis"):
        super().__init__(limits, by)
        self.predictions = check_integer("predictions", predictions)

    @classmethod
    def maker(cls, options: WorldOptions) -> Callable[[float], Decider]:
        """Return the rule fitted to an environment; its threshold is v."""
        paths = functools.cache(
            lambda: simulate_posterior_paths(FITTING_EPISODES, FITTING, **vars(options))
        )
        limits = functools.cache(lambda: accepted_errors(paths()))
        return lambda predictions: cls(limits(), int(predictions), rewarded(options))

    def decide(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[Actions, Any]:
        """See `Decider.decide`. The state is the last accepted action (N,), 0 for none, and how
        often in a row.
        """
        accepted = self.act(observation)
        last, row = state or (accepted, np.zeros(len(accepted), np.int64))
        goes_on = (accepted == last) & (
            Layout.of_rows(observation).read(observation, "ticks") > 1.5
        )
        row = np.where(accepted == 0, 0, np.where(goes_on, row + 1, 1))
        return np.where(row >= self.predictions, accepted, 0), (accepted, row)

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        """See `Decider.select_tracks`."""
        return None if state is None else tuple(part[tracks] for part in state)
