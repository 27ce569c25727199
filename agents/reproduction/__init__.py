"""Reproduction of the published tables and figures: `hybridtrack reproduce`.

`command` runs the studies of `baselines.papers`, `report` writes the tables, and `figures` draws the papers'
figures, with `zimchuk_figure` for the paper on filters.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
