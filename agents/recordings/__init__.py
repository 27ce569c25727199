"""Mode decisions on the user's own recordings: `hybridtrack track`.

`command` reads the file, runs ATE and writes the results; `figure` draws them.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
