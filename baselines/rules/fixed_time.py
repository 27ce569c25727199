"""A decision after a fixed number of ticks: the maximum-likelihood hypothesis is declared."""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from baselines.rules.decider import Actions, Decider, Observations, RowRule
from hybrid_env.checks import check_integer
from hybrid_env.observation import Layout

# Ticks; longer than any segment.
NO_EARLY_DECISION = 10_000_000


class FixedTimeDecider(RowRule):
    """Declares the maximum-likelihood hypothesis at a fixed tick of each segment, or at the end
    of a shorter one.
    """

    name = "fixed"
    title = "fixed time"
    symbol = "ticks"
    default = 25
    thresholds: ClassVar[tuple[float, ...]] = (
        5,
        10,
        15,
        18,
        20,
        22,
        24,
        25,
        26,
        28,
        30,
        32,
        34,
        36,
        40,
        45,
        50,
        60,
        80,
        100,
    )
    colour = "#a0a0a0"
    marker = "s"

    def __init__(self, ticks: int = 25):
        self.ticks = check_integer("ticks", ticks)

    @classmethod
    def maker(cls, options: Any) -> Callable[[float], Decider]:
        """See `Decider.maker`."""
        return lambda ticks: cls(int(ticks))

    def act(self, rows: Observations) -> Actions:
        """See `RowRule.act`."""
        layout = Layout.of_rows(rows)
        most_likely = layout.read(rows, "log_ratio").argmax(-1)
        decides = np.rint(layout.read(rows, "ticks")) >= self.ticks
        return np.where(decides, most_likely + 1, 0)


class LikeliestAtEndDecider(FixedTimeDecider):
    """Declares the maximum-likelihood hypothesis at the end of the segment."""

    name = "ml"
    title = "ML at the end"
    thresholds = (NO_EARLY_DECISION,)
    default = NO_EARLY_DECISION
    colour = "#2d0069"
    marker = "X"
