"""A frame of an episode as an array of pixels."""

import numpy as np
from numpy.typing import NDArray

from hybrid_env.extras import explained
from hybrid_env.rendering.history import History


def draw_frame(history: History) -> NDArray[np.uint8]:
    """Draw a frame of the episode so far, (height, width, 3), a new array. Matplotlib is imported
    when the first one is drawn.
    """
    if history.figure is None:
        with explained():
            from hybrid_env.rendering.figure import EpisodeFigure

        history.figure = EpisodeFigure(history.options, history.panel)
    frame: NDArray[np.uint8] = history.figure.draw(history)
    return frame
