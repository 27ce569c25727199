"""Classical decision rules that read the rows of the environment.

`decider` is the protocol that every rule and every learned agent follows. `sprt` is Wald's test as ATE uses
it, `msprt` the tests between all hypotheses, `fixed_time` the likeliest hypothesis after a given time, and
`bayes_risk` optimal stopping, fitted on the segments that `waited_paths` simulates.

May import: `hybrid_env`. Never `baselines.recordings`, `baselines.papers` or `agents`.
"""
