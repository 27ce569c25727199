"""The decider that knows no doubt: the likeliest hypothesis after a fixed number of ticks."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.deciders.decider import Actions, Observations
from hybrid_env.checks import check_integer
from hybrid_env.observation import Layout


class FixedTimeDecider:
    """Declares the hypothesis of maximum likelihood at a fixed tick of each segment.

    Args:
        ticks: when, from 1 on; a shorter segment is decided by the environment at its end.
    """

    def __init__(self, ticks: int = 25):
        self.ticks = check_integer("ticks", ticks)

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, None]:
        """See `Decider.predict`; there is no state."""
        layout = Layout.of_rows(observation)
        likeliest = layout.read(observation, "log_ratio").argmax(-1)
        due = np.rint(layout.read(observation, "ticks")) >= self.ticks
        return np.where(due, likeliest + 1, 0), None
