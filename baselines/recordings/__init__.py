"""Decision algorithms for recorded measurements, without an environment.

`ate` is adaptive trajectory estimation, which decides the mode of each segment at known switch times.
`change_detection` detects a switch at an unknown time. Both apply the published bank to arrays of measured
positions and return estimates and decisions. `kinematic_models` decides between CV, CA and CJ.

May import: `hybrid_env`, `baselines.deciders`, `baselines.filters`. Never `baselines.papers` or `agents`.
"""
