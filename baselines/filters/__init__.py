"""Filters that estimate a trajectory without decisions.

`recording` checks recorded measurements and computes the first estimate. `known_modes` is the Kalman filter
with known modes. A new filter is a file in this folder with a function that computes estimates and
covariances from recorded measurements, like `filter_known_modes`.

May import: `hybrid_env`. Never `baselines.recordings`, `baselines.papers` or `agents`.
"""
