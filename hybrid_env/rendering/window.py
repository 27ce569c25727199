"""The renderer of the environments, and a window that shows its frames at a constant rate."""

import os
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.extras import explained
from hybrid_env.model_options import ModelOptions
from hybrid_env.rendering import FRAME_SIZE
from hybrid_env.rendering.evidence import EvidencePanel, probability_panel, sprt_panel
from hybrid_env.rendering.history import History

RENDER_FPS = 10


class NoDisplayError(RuntimeError):
    """No window can be opened, with any video driver."""


class Window:
    """A pygame window of `RENDER_FPS` frames per second at most. The first frame opens it; pygame
    is imported only then.
    """

    def __init__(self) -> None:
        self.closed_by_user = False
        self._surface: Any = None
        self._clock: Any = None

    def wants_frame(self) -> bool:
        """Open the window if necessary and process its events. Returns False if the user has
        closed it.
        """
        if self.closed_by_user:
            return False
        pygame = _import_pygame()
        if self._surface is None:
            try:
                pygame.display.init()
                self._surface = pygame.display.set_mode(FRAME_SIZE)
            except pygame.error as error:
                pygame.display.quit()
                raise NoDisplayError(
                    f"no window can be opened ({error}): use render_mode='rgb_array'"
                ) from None
            pygame.display.set_caption("HybridTrack")
            self._clock = pygame.time.Clock()
        # All other events stay in the queue for the calling program.
        if pygame.event.get(pygame.QUIT):
            self.close()
            self.closed_by_user = True
        return not self.closed_by_user

    def show(self, frame: NDArray[np.uint8]) -> None:
        """Show a frame, (height, width, 4) uint8 RGBA, in the window opened by `wants_frame`."""
        pygame = _import_pygame()
        image = pygame.image.frombuffer(frame.tobytes(), FRAME_SIZE, "RGBA")
        self._surface.blit(image, (0, 0))
        pygame.display.flip()
        self._clock.tick(RENDER_FPS)

    def close(self) -> None:
        """Close the window, if there is one. The next frame opens a new one."""
        if self._surface is not None:
            _import_pygame().display.quit()
            self._surface = None
        self.closed_by_user = False


def display_available() -> bool:
    """Return whether a window can be opened on a display, without which SDL silently renders off
    screen. A working driver named in SDL_VIDEODRIVER counts as a display.
    """
    chosen = any(map(os.environ.get, ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER")))
    displays = any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    if sys.platform.startswith("linux") and not chosen and not displays:
        return False
    pygame = _import_pygame()
    try:
        pygame.display.init()
    except pygame.error:
        return False
    return chosen or pygame.display.get_driver() not in ("offscreen", "dummy")


def _import_pygame() -> Any:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    with explained():
        import pygame

    return pygame


class Renderer:
    """Draws an episode, frame by frame; human: in a window instead of returning the frames. Without
    a panel the evidence is that of the bank.
    """

    def __init__(self, options: ModelOptions, human: bool, panel: EvidencePanel | None = None):
        self.options = options
        self.panel = (
            panel or (sprt_panel if options.switches == "announced" else probability_panel)()
        )
        self.window = Window() if human else None
        self._figure: Any = None

    def __getstate__(self) -> dict[str, Any]:
        # Neither can be copied or pickled.
        return vars(self) | {"window": self.window and Window(), "_figure": None}

    def draw(self, history: History) -> Any:
        """Draw one frame of the episode so far, (height, width, 3) uint8, a new array; None if
        frames are shown in a window, also after the user has closed it, so that the calling loop
        can continue.
        """
        if self.window is not None and not self.window.wants_frame():
            return None
        if self._figure is None:
            with explained():
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
