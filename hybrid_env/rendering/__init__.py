"""Rendering of a running episode, with matplotlib for the frames and pygame for the window.

`history` has all ticks of the episode, `evidence` what the evidence panel shows, and names and colours of modes;
`figure` is a frame with two panels, `window` the renderer of the environments. Only `figure` imports matplotlib, and
the renderer imports it with its first frame.
"""

FRAME_SIZE = (900, 450)  # width, height [px]
