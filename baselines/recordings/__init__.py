"""Algorithms that decide on recorded measurements, without an environment.

`ate` is adaptive trajectory estimation: mode decisions where the moments of possible switches are known.
`change_detection` finds a switch at an unknown moment. Both run the published bank over arrays of positions
and return estimates and decisions.

May import: `hybrid_env`, `baselines.deciders`, `baselines.filters`. Never `baselines.papers` or `agents`.
"""
