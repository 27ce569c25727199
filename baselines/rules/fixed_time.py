"""A decision after a fixed number of ticks: the maximum-likelihood hypothesis is declared."""

from typing import Any, ClassVar

import numpy as np

from baselines.rules.decider import Actions, Decider, Observations, Variants
from hybrid_env.checks import check_integer
from hybrid_env.observation import Layout

# Ticks; longer than any segment.
NO_EARLY_DECISION = 10_000_000


class FixedTimeDecider(Decider):
    """Declares the maximum-likelihood hypothesis at a fixed tick of each segment, or at the end
    of a shorter one.

    Args:
        threshold: number of ticks.
    """

    name = "fixed"
    title = "fixed time"
    symbol = "ticks"
    default = 25
    thresholds = (5, 10, 15, 18, 20, 22, 24, 25, 26, 28, 30, 32, 34, 36, 40, 45, 50, 60, 80, 100)
    variants: ClassVar[Variants] = {
        "at-once": {"title": "likeliest at once", "thresholds": (1,), "default": 1, "threshold": 1},
        "ml": {
            "title": "ML at the end",
            "thresholds": (NO_EARLY_DECISION,),
            "default": NO_EARLY_DECISION,
            "threshold": NO_EARLY_DECISION,
        },
    }

    def check_threshold(self, threshold: Any) -> float:
        """See `Decider.check_threshold`."""
        whole = isinstance(threshold, float) and threshold.is_integer()
        return check_integer("ticks", int(threshold) if whole else threshold)

    def act(self, rows: Observations) -> Actions:
        """See `Decider.act`."""
        layout = Layout.of_rows(rows)
        most_likely = layout.read(rows, "log_ratio").argmax(-1)
        decides = np.rint(layout.read(rows, "ticks")) >= self.threshold
        return np.where(decides, most_likely + 1, 0)
