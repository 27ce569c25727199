"""Rendering of a running episode, with matplotlib for the frames and pygame for the window.

- `modes`: names and colours of the hypotheses.
- `history`: all ticks and decisions of the episode.
- `evidence`: description of the evidence panel.
- `track_axes`, `evidence_axes`: the two panels of a frame, with the `decision_markers` of both.
- `figure`: the frame, and the renderer of the environment.
- `quickest_history`, `quickest_figure`: the same with unknown switch moments.
- `window`: a window on the screen.

May import: options and checks of `hybrid_env`, column names of `hybrid_env.core.records`.
"""
