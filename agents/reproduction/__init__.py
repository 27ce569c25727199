"""The papers' tables beside ours: `hybridtrack reproduce`.

`command` runs the studies of `baselines.papers`, `report` writes the tables, `figures` draws the papers'
figures.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
