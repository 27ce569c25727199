"""Watching or saving episodes: `hybridtrack play`.

- `command`: the command; it plays the episodes and writes the files.
- `episodes`: episodes of a decider, with announced or with unknown switch moments, and their tables.
- `animation`: animated GIFs.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
