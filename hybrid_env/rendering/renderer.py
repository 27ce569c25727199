"""The renderer of the environments."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid_env.options import ModelOptions
from hybrid_env.rendering.evidence import EvidencePanel
from hybrid_env.rendering.history import History
from hybrid_env.rendering.window import FRAME_SIZE, RENDER_FPS, Window

if TYPE_CHECKING:
    from hybrid_env.rendering.figure import EpisodeFigure


class Renderer:
    """Draws an episode, frame by frame.

    Args:
        options: of the world.
        human: whether frames are shown in a window instead of being returned.
        panel: what the evidence panel shows.
    """

    def __init__(self, options: ModelOptions, human: bool, panel: EvidencePanel):
        self.options, self.panel = options, panel
        self.window = Window(RENDER_FPS) if human else None
        self._figure: EpisodeFigure | None = None

    def __getstate__(self) -> dict[str, Any]:
        window = None if self.window is None else Window(self.window.fps)
        return self.__dict__ | {"window": window, "_figure": None}  # neither can be copied or pickled

    def draw(self, history: History) -> Any:
        """Draw one frame of the episode so far. Matplotlib is imported with the first one.

        Returns:
            (height, width, 3) uint8, a new array; None if frames are shown in a window. After the user has
            closed the window, this method does nothing, so that the calling loop can continue.

        Raises:
            NoDisplayError: SDL cannot open a window.
        """
        if self.window is not None and not self.window.wants_frame(FRAME_SIZE):
            return None
        if self._figure is None:
            from hybrid_env.rendering.figure import EpisodeFigure

            self._figure = EpisodeFigure(self.options, self.panel)
        frame = self._figure.draw(history)
        if self.window is None:
            return np.array(frame[..., :3])
        self.window.show(frame)
        return None

    def close(self) -> None:
        """Close the window, if there is one. The next call of `draw` opens a new one."""
        if self.window is not None:
            self.window.close()
