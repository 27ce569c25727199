"""What is measured of decisions and statements, and how certain it is. `decisions` has the
values of declarations. `timelines` says what a switch, a delay, a miss and a false change are,
and counts them at samples of any spacing; `statements` has the values of many tracks at ticks.
`score` scores statements of any origin. `scores` holds the values of a decider on every episode
at every threshold; `estimates` has the one bootstrap. May import: `hybrid_env`. It needs NumPy
and SciPy only.
"""
