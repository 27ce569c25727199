"""Speed beside what people would use instead: `hybridtrack bench`.

`command` has the flags, `measurements` takes them in turn, `peers` are banks written without this package,
`report` writes table and figure.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
