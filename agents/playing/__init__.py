"""Watching or saving episodes: `hybridtrack play`.

- `command`: the command; it plays the episodes and writes the files.
- `evidence`: what each decider compares with its threshold, for the evidence panel.
- `animation`: animated GIFs.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
