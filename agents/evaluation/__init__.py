"""Any decider on fixed episodes.

`deciders` finds a decider by its name and lists the thresholds to sweep; `evaluate` runs it on the episodes
of given seeds; `operating_curve` sweeps its threshold; `shifted_worlds` changes the world. `seeds` keeps
the episodes of different purposes apart. `command` is `hybridtrack evaluate`.

May import: `hybrid_env`, `baselines`, `agents.interface`, `agents.learned`.
"""
