"""What decides from rows or measurements: classical rules for every task.

`decider` has the base class of every rule and agent, and finds a rule by its name; a new rule is
one file. `external` finds and checks those of users. `rollout` is the loop around environment and
decider. For announced switches `propagated` has filters of its own (`component_filters`), whose
anchors have the distribution of `anchor_errors`. For unknown switches `glr` and `beam` filter
the `measurements` themselves; `beam_prior` has the laws of durations among which a beam learns.
`hindsight` decides a whole recording by the `lattice` of the segments that a beam has followed.
May import: `hybrid_env`, and `estimation` and `scoring` of `baselines`. Never `agents`.
"""
