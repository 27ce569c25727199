"""Rendering of a running episode, with matplotlib for the frames and pygame for the window.

- `modes`: names and colours of the hypotheses.
- `history`: all ticks of the episode: the true modes beside the stated ones.
- `evidence`: description of the evidence panel.
- `panels`: the two panels of a frame.
- `figure`: the frame.
- `window`: a window on the screen.
- `renderer`: the renderer of the environments, with announced and with unknown switch moments.

May import: options and checks of `hybrid_env`, column names of `hybrid_env.core.records`. Only `panels` and
`figure` import matplotlib, and the renderer imports them with its first frame.
"""
