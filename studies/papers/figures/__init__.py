"""The figures of each paper: one file by its name, with `draw(result)`, which returns them by
file name.
"""
