"""What limits decisions: `hybridtrack limits`.

`command` defines the flags, `study` evaluates each bank, rule and noise level with known switch moments,
`report` writes the tables, and `figure` draws the decision times. `statement_study`, `statement_report` and
`statement_figure` are the same for unknown switch moments, from the filter bank to an off-line smoother.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
