"""A threshold with hysteresis on the probabilities of the bank."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.deciders.decider import Actions, Observations
from hybrid_env.checks import check_number, reject
from hybrid_env.observation import QuickestLayout


class ThresholdDecider:
    """Changes its statement to the most probable mode when that is probable enough.

    Between the two thresholds the last statement is kept, so that it does not alternate while two modes are
    about equally probable.

    Args:
        threshold: smallest probability of a mode to which the statement changes, 0 to 1.
        release: largest probability of the stated mode at which the statement may change, 0 to 1; 1 has no
            effect.

    Raises:
        ArgumentError: an argument is out of range.
    """

    def __init__(self, threshold: float = 0.6, release: float = 1.0):
        self.threshold = _check_probability("threshold", threshold)
        self.release = _check_probability("release", release)

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Actions, None]:
        """See `Decider.predict`; action i states mode i. The decider has no state: rows have the statement.

        Args:
            observation: (N, 6 M + 2) rows of `hybrid_env.HybridTrackQuickestEnv`.
            state, episode_start, deterministic: not used.
        """
        layout = QuickestLayout.of_rows(observation)
        log_probability = layout.read(observation, "log_probability")
        return self.choose(log_probability, *read_statement(observation)), None

    def choose(
        self, log_probability: NDArray[np.float64], stated: Actions, started: NDArray[np.bool_]
    ) -> Actions:
        """Return the next statements of N tracks, (N,).

        Args:
            log_probability: (N, M) logarithms of the probabilities of the modes.
            stated: (N,) last statements.
            started: (N,) whether there has been a statement; the first one is the most probable mode.
        """
        best = log_probability.argmax(-1)
        of_best, of_stated = (
            np.exp(np.take_along_axis(log_probability, mode[:, None], -1)[:, 0]) for mode in (best, stated)
        )
        changes = (of_best >= self.threshold) & (of_stated <= self.release)
        return np.where(changes | ~started, best, stated)


def read_statement(observation: Observations) -> tuple[Actions, NDArray[np.bool_]]:
    """Return the last stated mode of N tracks, (N,), and whether there has been a statement, (N,)."""
    stated = QuickestLayout.of_rows(observation).read(observation, "stated")
    return stated.argmax(-1), stated.max(-1) > 0.0


def _check_probability(name: str, value: Any) -> float:
    allowed = "a number from 0 to 1"
    number = check_number(name, value, allowed)
    if not 0.0 <= number <= 1.0:
        raise reject(name, value, allowed)
    return number
