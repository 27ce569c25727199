"""Filters that estimate a trajectory and decide nothing.

`recording` checks recorded measurements and gives a first estimate; `known_modes` is the Kalman filter that
is told every mode. A further filter is one file here with a function from recorded measurements to
estimates and covariances, as `filter_known_modes` has it.

May import: `hybrid_env`. Never `baselines.recordings`, `baselines.papers` or `agents`.
"""
