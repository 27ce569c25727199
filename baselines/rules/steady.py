"""A threshold on the probabilities of the bank whose statements last."""

import math
from typing import Any

import numpy as np

from baselines.rules.decider import Actions, Observations
from baselines.rules.threshold import ThresholdDecider, read_statement
from hybrid_env.checks import IntArray
from hybrid_env.observation import QuickestLayout


class SteadyDecider(ThresholdDecider):
    """Changes its statement to the most probable mode when that is probable enough, or likelier
    than all others together at each of the last three measurements. A statement lasts for at least
    three.

    A threshold alone states a mode for a single measurement when one error moves the probabilities
    across it and back, and keeps an improbable mode while the new one stays below it.

    Args:
        threshold: smallest probability of a mode to which the statement changes at once, 0 to 1.
    """

    name = "steady"
    title = "IMM steady"
    default = 0.75
    # For which a mode leads, and smallest number for which a statement lasts.
    measurements = 3

    def decide(
        self, observation: Observations, state: Any, episode_start: Any
    ) -> tuple[Actions, tuple[IntArray, IntArray, IntArray]]:
        """See `Decider.decide`; rows tell where an episode begins. The state, (N,) each, is the
        most probable mode, the number of the last measurements at which it has been likelier than
        all others together, and the number of measurements for which the statement has lasted.
        """
        log_probability = QuickestLayout.of_rows(observation).read(observation, "log_probability")
        stated, started = read_statement(observation)
        best = log_probability.argmax(-1)
        start = best, np.zeros_like(best), np.full_like(best, self.measurements)
        leader, leads, lasts = state or start
        largest = log_probability.max(-1)
        leads = np.where(started & (leader == best), leads + 1, 1)
        leads *= largest > math.log(0.5)
        level = math.log(self.threshold) if self.threshold > 0.0 else -math.inf
        likely = (largest >= level) | (leads >= self.measurements)
        changes = ~started | (likely & (best != stated) & (lasts >= self.measurements))
        lasts = np.where(changes, 1, lasts + 1)
        return np.where(changes, best, stated), (best, leads, lasts)
