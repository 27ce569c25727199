"""Reproduction of the published tables and figures: `hybridtrack reproduce`.

A paper is a study in `baselines.papers` and a file of the same name in `figures`, by which it is found and
which draws its figures. `command` runs the studies and writes their tables.

May import: `hybrid_env`, `baselines`, and `interface`, `figures`, `learned`, `evaluation` and `training` of
`agents`; no other study.
"""
