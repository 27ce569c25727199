"""A window that shows frames at a constant rate."""

import os
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

RENDER_FPS = 10
FRAME_SIZE = (900, 450)  # width, height [px]


class NoDisplayError(RuntimeError):
    """No window can be opened, with any video driver."""


class Window:
    """A pygame window. The first frame opens it; pygame is imported only then.

    Args:
        fps: maximum number of frames per second; `show` waits accordingly.

    Attributes:
        closed_by_user: True after the user has closed the window, until `close` is called.
    """

    def __init__(self, fps: int):
        self.fps = fps
        self.closed_by_user = False
        self._surface: Any = None
        self._clock: Any = None

    def wants_frame(self, size: tuple[int, int]) -> bool:
        """Open the window if necessary and process its events.

        Args:
            size: (width, height) [px].

        Returns:
            False if the user has closed the window.

        Raises:
            NoDisplayError: SDL cannot open a window.
        """
        if self.closed_by_user:
            return False
        if self._surface is None:
            self._open(size)
        pygame = _import_pygame()
        if pygame.event.get(pygame.QUIT):  # all other events stay in the queue for the calling program
            self.close()
            self.closed_by_user = True
        return not self.closed_by_user

    def show(self, frame: NDArray[np.uint8]) -> None:
        """Show a frame, (height, width, 4) uint8 RGBA, in the window opened by `wants_frame`."""
        pygame = _import_pygame()
        height, width = frame.shape[:2]
        self._surface.blit(pygame.image.frombuffer(frame.tobytes(), (width, height), "RGBA"), (0, 0))
        pygame.display.flip()
        self._clock.tick(self.fps)

    def close(self) -> None:
        """Close the window, if there is one. The next frame opens a new one."""
        if self._surface is not None:
            _import_pygame().display.quit()
            self._surface = None
        self.closed_by_user = False

    def _open(self, size: tuple[int, int]) -> None:
        pygame = _import_pygame()
        try:
            pygame.display.init()
            self._surface = pygame.display.set_mode(size)
        except pygame.error as error:
            pygame.display.quit()
            raise NoDisplayError(f"no window can be opened ({error}): use render_mode='rgb_array'") from None
        pygame.display.set_caption("HybridTrack")
        self._clock = pygame.time.Clock()


def display_available() -> bool:
    """Return whether a window can be opened on a display.

    Without a display, SDL silently renders off screen. A working driver named in SDL_VIDEODRIVER counts as a
    display, even if it renders off screen.
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
    import pygame

    return pygame
