"""A threshold on the probabilities of the bank whose statements last."""

from typing import Any, NamedTuple, Self

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


class SteadyState(NamedTuple):
    """State of N tracks, (N,) each."""

    # Most probable mode, or if its type is not stated, -1 less its type.
    leader: IntArray
    # Number of the last measurements at which it has been likelier than all others together.
    leads: IntArray
    # Number of measurements for which the statement has lasted.
    lasts: IntArray


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

    @classmethod
    def create(cls, options: Any, **arguments: Any) -> Self:
        """See `Decider.create`."""
        return super().create(options, types=options.types, **arguments)

    def decide(
        self, observation: Observations, state: SteadyState | None, episode_start: Any
    ) -> tuple[Actions, SteadyState]:
        """See `Decider.decide`; rows tell where an episode begins."""
        layout = QuickestLayout.of_rows(observation)
        probability = np.exp(layout.read(observation, "log_probability"))
        tracks, modes = np.arange(len(probability)), np.arange(probability.shape[1])
        types = modes if self._types is None else self._types
        stated, started = read_statement(observation)
        best = (probability @ worth_of(types)).argmax(-1)
        # The radius of a turn that is stated may change, too.
        another = types[best] != types[stated]
        of_type = probability @ np.equal.outer(types, types)
        largest = np.where(another, of_type[tracks, best], probability[tracks, best])
        leader = np.where(another, -1 - types[best], best)
        if state is None:
            state = SteadyState(leader, np.zeros_like(best), np.full_like(best, self.lasting))
        leads = np.where(started & (state.leader == leader), state.leads + 1, 1)
        leads *= largest > 0.5
        likely = (largest >= self.threshold) | (leads >= self.leading)
        changes = ~started | (likely & (best != stated) & (state.lasts >= self.lasting))
        lasts = np.where(changes, 1, state.lasts + 1)
        return np.where(changes, best, stated), SteadyState(leader, leads, lasts)
