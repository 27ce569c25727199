"""What decides from rows or measurements: classical rules for every task, and the live tracker.

`decider` has the base class of every rule and agent, and finds a rule by its name; a new rule is one file.
`rollout` is the loop around environment and decider.

Announced switches: `sprt`, `msprt` and `fixed_time` read rows of `hybrid_env.HybridTrackEnv`, `bayes_risk` is
fitted to `posterior_paths`, `refiltering` has filters of its own, whose anchors have the distribution of
`anchor_prior`. Unknown switches: `threshold` and `change_detection` read rows of
`hybrid_env.HybridTrackQuickestEnv`; `restarted` and `beam` filter the `measurements` themselves,
`beam_smoother` also those of later ticks. `flight_rules` are the rules on recorded flights. `decisions` and
`statements` record what a decider declares or states. `tracker` puts a rule behind a live sensor, `start`
begins its track.

May import: `hybrid_env`, `baselines.estimation`, `baselines.scoring`. Never `agents`.
"""
