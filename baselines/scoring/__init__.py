"""What is measured of decisions and statements, and how certain it is. `decisions` has the figures
of declarations, `statements` compares statements with true modes at ticks, `timelines` at samples
of any spacing. `score` scores statements of any origin. `scores` holds the figures of a decider on
every episode at every threshold; `estimates` has the one bootstrap. May import: `hybrid_env`. It
needs NumPy and SciPy only.
"""
