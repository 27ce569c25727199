"""Classical decision rules that read the observation rows of the environment.

`decider` is the protocol of all rules and learned agents. `sprt` is Wald's test as ATE uses it, `msprt` has
the tests between all hypotheses, and `fixed_time` decides after a fixed number of ticks. `bayes_risk` is
optimal stopping, fitted to the segments that `posterior_paths` simulates.

May import: `hybrid_env`. Never `baselines.recordings`, `baselines.papers` or `agents`.
"""
