"""What decides from rows or measurements: classical rules for every task, and the live tracker.

`decider` has the base class of every rule and agent, and finds a rule by its name; a new rule is one file. `rollout` is
the loop around environment and decider, and records declarations and statements.

Announced switches: `sprt`, `msprt` and `fixed_time` read rows of `hybrid_env.HybridTrackEnv`, `bayes_risk` and `teaser`
are fitted to `posterior_paths`, `refiltering` has filters of its own (`component_filters`), whose anchors have the
distribution of `anchor_prior`. Unknown switches: `threshold` and `change_detection` read rows of
`hybrid_env.HybridTrackQuickestEnv`; `restarted` and `beam` filter the `measurements` themselves, `beam_smoother` also
those of later ticks. Those on recorded flights stand in `change_detection`, those on gliders in `circling`. `tracker`
puts a rule behind a live sensor, `start` begins its track and has the gate of its measurements.

May import: `hybrid_env`, and `estimation` and `scoring` of `baselines`. Never `agents`.
"""
