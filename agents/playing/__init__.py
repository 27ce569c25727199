"""One episode, watched or kept as a file: `hybridtrack play`.

`command` lets a decider play and writes animation, picture or recording.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
