"""A window on the screen that shows frames at a steady pace."""

import os
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray


class NoDisplayError(RuntimeError):
    """No window can be opened, not even off screen."""


class Window:
    """Opened by the first frame, with pygame, which is not imported before.

    Args:
        fps: most frames a second; `show` waits to keep to it.

    Attributes:
        closed_by_user: True from the moment when the user closes the window until `close`.
    """

    def __init__(self, fps: int):
        self.fps = fps
        self.closed_by_user = False
        self._surface: Any = None
        self._clock: Any = None

    def wants_frame(self, size: tuple[int, int]) -> bool:
        """Open the window if need be and read its events; False once the user has closed it.

        Args:
            size: (width, height) [px].

        Raises:
            NoDisplayError: SDL cannot open a window.
        """
        if self.closed_by_user:
            return False
        if self._surface is None:
            self._open(size)
        pygame = _import_pygame()
        if pygame.event.get(pygame.QUIT):  # other events are left to the caller's program
            self.close()
            self.closed_by_user = True
        return not self.closed_by_user

    def show(self, frame: NDArray[np.uint8]) -> None:
        """Show a frame, (height, width, 4) uint8 RGBA, in the window that `wants_frame` has opened."""
        pygame = _import_pygame()
        height, width = frame.shape[:2]
        self._surface.blit(pygame.image.frombuffer(frame.tobytes(), (width, height), "RGBA"), (0, 0))
        pygame.display.flip()
        self._clock.tick(self.fps)

    def close(self) -> None:
        """Close the window, if there is one; the next frame opens another."""
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
    """Whether a window would be seen.

    Where it would not, SDL draws off screen without a word. A driver named in SDL_VIDEODRIVER counts as
    seen, whatever it is, as long as it works.
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
