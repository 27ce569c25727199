"""What limits a decision, from ATE to an oracle: `hybridtrack limits`.

`command` has the flags, `study` measures each bank, rule and noise level, `report` writes the tables and
figure.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
