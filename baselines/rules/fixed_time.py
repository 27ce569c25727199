"""A decision after a fixed number of ticks: the maximum-likelihood hypothesis is declared."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.rules.decider import Actions, Observations
from hybrid_env.checks import check_integer
from hybrid_env.observation import Layout


class FixedTimeDecider:
    """Declares the maximum-likelihood hypothesis at a fixed tick of each segment.

    Args:
        ticks: tick of the decision, at least 1. The environment decides shorter segments at their end.

    Raises:
        ArgumentError: `ticks` is not an integer >= 1.
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
        """See `Decider.predict`. The decider has no state."""
        layout = Layout.of_rows(observation)
        most_likely = layout.read(observation, "log_ratio").argmax(-1)
        decides = np.rint(layout.read(observation, "ticks")) >= self.ticks
        return np.where(decides, most_likely + 1, 0), None
