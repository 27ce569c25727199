"""Animated GIFs of rendered frames."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from agents.interface.output_files import atomic_file
from hybrid_env.checks import reject
from hybrid_env.options import ModelOptions
from hybrid_env.rendering.evidence import mode_colour, shade
from hybrid_env.rendering.panels import CURRENT_COLOUR
from hybrid_env.rendering.window import RENDER_FPS

Frame = NDArray[np.uint8]

MAX_FRAMES = 1700  # Pillow has all of them in memory before it writes the file
PALETTE_SIZE = 255  # a GIF has 256 colours, and Pillow uses one for unchanged pixels


def write_gif(path: Path, frames: Iterator[Frame], options: ModelOptions) -> None:
    """Write frames, (height, width, 3) uint8, as an endless animation with RENDER_FPS frames per second.

    All frames share one palette. With one palette for each frame, which is the default of Pillow, files are
    four to seven times as large and unchanged pixels flicker.

    Raises:
        ArgumentError: there are too many frames, or the file cannot be written.
    """
    palette = Image.new("P", (1, 1))
    palette.putpalette(palette_colours(options).tobytes())
    images = (
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in _bounded(path, frames)
    )
    with atomic_file(path) as part:
        next(images).save(
            part,
            format="GIF",
            save_all=True,
            append_images=images,
            duration=round(1000 / RENDER_FPS),
            loop=0,
        )


def _bounded(path: Path, frames: Iterator[Frame]) -> Iterator[Frame]:
    for number, frame in enumerate(frames, start=1):
        if number > MAX_FRAMES:
            raise reject("out", str(path), f"at most {MAX_FRAMES} frames: choose fewer or shorter episodes")
        yield frame


def palette_colours(options: ModelOptions) -> NDArray[np.uint8]:
    """Return the colours of all frames and their mixtures with white, (n, 3) with n <= PALETTE_SIZE."""
    greys = [f"#{level:02x}{level:02x}{level:02x}" for level in range(0, 256, 17)]
    current = [shade(CURRENT_COLOUR, amount) for amount in (-0.75, -0.5, -0.25, 0.0, 0.5)]
    modes = [mode_colour(mode, options.radii) for mode in range(options.hypotheses)]
    available = PALETTE_SIZE - len(greys) - len(current)
    steps = min(max(available // len(modes), 1), 12)
    mixtures = [shade(colour, step / steps) for step in range(steps) for colour in modes]
    colours = [*greys, *current, *mixtures[:available]]
    return np.array([[int(colour[k : k + 2], 16) for k in (1, 3, 5)] for colour in colours], np.uint8)
