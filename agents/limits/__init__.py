"""What limits decisions: `hybridtrack limits`.

`command` defines the flags, `study` evaluates each bank, rule and noise level with known switch moments,
`steps` says what each step from ATE to the bound is worth, `report` writes the tables, and `figures` draws
them. The files `statement_*` are the same for unknown switch moments, from the filter bank to a
smoother that sees later measurements.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `figures`, `learned`, `evaluation`, `training`;
no other study.
"""
