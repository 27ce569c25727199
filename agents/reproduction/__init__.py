"""Reproduction of the published tables and figures: `hybridtrack reproduce`.

`command` runs the studies of `baselines.papers`, `report` writes the tables, and `figures` draws the papers'
figures, on the `canvas` that all have in common. `zimchuk_figure` and `novospaskyi_figures` are those of the
papers on filters; `novospaskyi_study` runs the radar study with its progress display.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
