"""Watching or saving episodes: `hybridtrack play`.

- `command`: the command; it plays the episodes and writes the files.
- `episodes`: one episode of a decider, in each kind of environment, and its table.
- `evidence`, `statement_evidence`: what each decider compares with its threshold, for the right-hand panel.
- `animation`: animated GIFs.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
