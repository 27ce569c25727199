"""A threshold on the probabilities of the bank whose statements last."""

from typing import Any, Self

import numpy as np

from baselines.rules.decider import Actions, Observations
from baselines.rules.threshold import ThresholdDecider, read_statement
from hybrid_env.checks import FloatArray, IntArray
from hybrid_env.observation import QuickestLayout


def worth_of(types: IntArray) -> FloatArray:
    """Return what a measurement of a mode (column) is worth if another one (row) is true, (M, M).

    A mode of the same type, such as a turn of another radius to the same side, is four fifths
    right, so that the radius of a turn does not change with the noise.

    Args:
        types: (M,) numbers that are equal for modes of one type.
    """
    worth: FloatArray = 0.8 * np.equal.outer(types, types) + 0.2 * np.eye(len(types))
    return worth


class SteadyDecider(ThresholdDecider):
    """Changes its statement to the most probable mode when that is probable enough, or likelier
    than all others together at each of the last five measurements. A statement lasts for at least
    three. Modes of one type, such as turns to one side, count together.

    A threshold alone states a mode for a single measurement when one error moves the probabilities
    across it and back, and keeps an improbable mode while the new one stays below it.

    Args:
        threshold: smallest probability of a mode to which the statement changes at once, 0 to 1.
        types: (M,) numbers that are equal for modes of one type; None if all are different.
    """

    name = "steady"
    title = "IMM steady"
    default = 0.95
    # For which a mode leads, and smallest number for which a statement lasts.
    leading = 5
    lasting = 3

    def __init__(self, threshold: float | None = None, types: IntArray | None = None):
        super().__init__(threshold)
        self._types = types
        if types is not None:
            self._same, self._worth = np.equal.outer(types, types), worth_of(types)

    @classmethod
    def create(cls, options: Any, **arguments: Any) -> Self:
        """See `Decider.create`."""
        types = options.types
        distinct = len({*types.tolist()}) == len(types)
        return super().create(options, types=None if distinct else types, **arguments)

    def decide(
        self, observation: Observations, state: Any, episode_start: Any
    ) -> tuple[Actions, tuple[IntArray, IntArray, IntArray]]:
        """See `Decider.decide`; rows tell where an episode begins. The state, (N,) each, is the
        leader: the most probable mode, or if its type is not stated, -1 less its type; the number
        of the last measurements at which it has been likelier than all others together; and the
        number of measurements for which the statement has lasted.
        """
        layout = QuickestLayout.of_rows(observation)
        probability = np.exp(layout.read(observation, "log_probability"))
        stated, started = read_statement(observation)
        best, largest = probability.argmax(-1), probability.max(-1)
        leader = best
        if self._types is not None:
            best, largest, leader = self._of_types(self._types, probability, stated)
        led, leads, lasts = state or (leader, np.zeros_like(best), np.full_like(best, self.lasting))
        leads = np.where(started & (led == leader), leads + 1, 1)
        leads *= largest > 0.5
        likely = (largest >= self.threshold) | (leads >= self.leading)
        changes = ~started | (likely & (best != stated) & (lasts >= self.lasting))
        lasts = np.where(changes, 1, lasts + 1)
        return np.where(changes, best, stated), (leader, leads, lasts)

    def _of_types(
        self, types: IntArray, probability: FloatArray, stated: Actions
    ) -> tuple[Actions, FloatArray, IntArray]:
        """Return the best mode, its probability, and the leader, (N,) each, where those of one type
        count together. The radius of a turn that is stated changes likewise, by the probability of
        the mode alone.
        """
        of_type = probability @ self._same
        best = (probability @ self._worth).argmax(-1)
        another = types[best] != types[stated]
        tracks = np.arange(len(best))
        largest = np.where(another, of_type[tracks, best], probability[tracks, best])
        return best, largest, np.where(another, -1 - types[best], best)
