"""Markers of decisions, the same in both panels: a circle if correct, a cross if wrong."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from hybrid_env.rendering.history import Decision
from hybrid_env.rendering.modes import mode_colour

CORRECT, WRONG = "o", "X"


class DecisionMarkers:
    """Markers in the colour of the decided mode.

    Args:
        axes: in which they are drawn.
        radii: (n,) turn radii of the bank [m].

    Attributes:
        artists: one collection for correct decisions and one for wrong decisions.
    """

    def __init__(self, axes: Any, radii: Sequence[float]):
        self.radii = radii
        self.artists = [
            axes.scatter([], [], s=45, marker=marker, edgecolors="black", zorder=3, clip_on=False)
            for marker in (CORRECT, WRONG)
        ]

    def update(self, decisions: Sequence[Decision], points: Sequence[tuple[float, float]]) -> None:
        """Draw each decision at its point, in the coordinates of the axes."""
        for markers, correct in zip(self.artists, (True, False), strict=True):
            chosen = [index for index, decision in enumerate(decisions) if decision.correct == correct]
            markers.set_offsets(np.reshape([points[index] for index in chosen], (-1, 2)))
            markers.set_facecolor([mode_colour(decisions[index].mode, self.radii) for index in chosen])


def decision_legend() -> dict[str, Line2D]:
    """Return the entries of the legend with their handles."""
    return {
        name: Line2D(
            [], [], color="white", marker=marker, markersize=7, linestyle="none", markeredgecolor="black"
        )
        for name, marker in (("correct decision", CORRECT), ("wrong decision", WRONG))
    }
