"""Rendering of a running episode: `history` has all ticks, `evidence` what the evidence panel
shows, with names and colours of modes, `figure` is a frame with two panels, `window` the renderer.
Only `figure` imports matplotlib, with the first frame.
"""

# Width, height [px].
FRAME_SIZE = (900, 450)
