"""Rendering of a running episode, with matplotlib for the frames and pygame for the window.

- `history`: all ticks of the episode: the true modes beside the stated ones.
- `evidence`: description of the evidence panel; names and colours of the hypotheses.
- `panels`: the two panels of a frame.
- `figure`: the frame.
- `window`: the renderer of the environments, and its window on the screen.

May import: options and checks of `hybrid_env`, column names of `hybrid_env.core.records`. Only `panels` and
`figure` import matplotlib, and the renderer imports them with its first frame.
"""

FRAME_SIZE = (900, 450)  # width, height [px]
