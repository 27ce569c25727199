"""Attainable decision times of the classical rules on each filter bank: `hybridtrack limits`.

`command` defines the flags, `study` evaluates each bank, rule and noise level, `report` writes the tables,
and `figure` draws the decision times.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
