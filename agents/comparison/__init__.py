"""Deciders side by side on the same episodes: `hybridtrack compare`.

`command` has the flags, `study` trains, sweeps and measures, `report` prints the tables, `figure` draws the
operating curves and `episode_figure` one episode with two deciders.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
