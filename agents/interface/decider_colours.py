"""Colours and markers of deciders in figures."""

COLOURS = ("#4477AA", "#BBBBBB", "#EE6677", "#228833", "#CCBB44", "#66CCEE", "#AA3377")  # Tol's bright scheme


MARKERS = ("o", "s", "D", "^", "v", "P", "X")
