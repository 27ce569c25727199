"""The protocol that every decision rule follows, classical or learned."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Observations = NDArray[np.float32]
Actions = NDArray[np.int64]


class Decider(Protocol):
    """A decision rule with the `predict` signature of Stable-Baselines3, vectorised over tracks.

    A decider with filters of its own has an attribute `every_tick` that is True: `baselines.OnlineTracker`
    asks it also in ticks without a measurement, so that its filters predict. One that cannot predict has an
    attribute `needs_measurements` that is True. One for `HybridTrackQuickestEnv` that needs more than rows
    has a method `observe`; its result for the world is then given in place of the rows.

    One that compares a quantity of its own with its threshold may show it: `evidence`, with the first three
    arguments of `predict`, returns this quantity for each hypothesis, (N, M), and leaves the state as it is;
    `panel` returns the `EvidencePanel` in which it is drawn.
    """

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Any]:
        """Return the actions of N tracks for one step.

        Args:
            observation: (N, width) rows of the environment, see its docstring.
            state: the state that the previous call returned; None at the first step.
            episode_start: (N,) True where an episode begins.
            deterministic: if False, a stochastic decider samples its actions.

        Returns:
            (N,) actions of the environment (in `HybridTrackEnv` 0 waits and i + 1 declares hypothesis i, in
            `HybridTrackQuickestEnv` i states hypothesis i) and the new state.
        """
        ...
