"""Rendering of a running episode: `history` has all ticks, `evidence` what the evidence panel
shows, with names and colours of modes, `figure` draws a frame with two panels. Only `figure`
imports matplotlib, with the first frame.
"""

from importlib.util import find_spec
from typing import Any

# Of environments: `check_env` of Gymnasium draws a frame in each of the modes.
METADATA: dict[str, Any] = {
    "render_modes": ["rgb_array"] if find_spec("matplotlib") else [],
    "render_fps": 10,
}
# Width, height [px]: text of 9 pt can be read on a narrow screen.
FRAME_SIZE = (450, 620)
