"""What the pictures of several studies draw alike."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from baselines import Estimate


def draw_estimates(
    axes: Axes, places: Any, estimates: Sequence[Estimate], horizontal: bool = False, **style: Any
) -> None:
    """Draw estimates with their intervals over places (n,), or beside them."""
    value, low, high = np.array([[*vars(estimate).values()] for estimate in estimates]).T
    bars = value - low, high - value
    if horizontal:
        axes.errorbar(value, places, xerr=bars, **style)
    else:
        axes.errorbar(places, value, yerr=bars, **style)
