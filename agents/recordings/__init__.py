"""Mode decisions on recordings of positions: `hybridtrack track`.

`command` reads the file, runs ATE and writes the results. `figure` draws them.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
