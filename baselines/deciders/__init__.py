"""Classical decision rules that read the observation rows of the environment.

`decider` is the protocol of all rules and learned agents. `sprt` is Wald's test as ATE uses it, `msprt` has
the tests between all hypotheses, and `fixed_time` decides after a fixed number of ticks. `bayes_risk` is
optimal stopping, fitted to the segments that `posterior_paths` simulates. `refiltering` has rules that run
filters of their own on the measurements (`component_filters`), started from the distribution of the anchor
error (`anchor_prior`).

May import: `hybrid_env`. Never `baselines.recordings`, `baselines.papers` or `agents`.
"""
