"""What everything that decides looks like, classical or learned."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Observations = NDArray[np.float32]
Actions = NDArray[np.int64]


class Decider(Protocol):
    """Stable-Baselines3's own signature, vectorised over tracks."""

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Any]:
        """Answer one step of N tracks.

        Args:
            observation: (N, 6 M + 10) rows of the environment.
            state: what the last call returned; None at the very first step.
            episode_start: (N,) True where an episode begins.
            deterministic: False lets a stochastic decider sample.

        Returns:
            (N,) actions, 0 waits and i + 1 declares hypothesis i; and the new state.
        """
        ...
