"""Learned deciders: networks, policies, and their files.

`sequence` is the recurrent network that corrects the bank's likelihood; `policy` wraps an actor of
Stable-Baselines3; `stopping` lets such an actor decide on what the sequence network computes; `features`
selects what an actor sees. `policy_file` reads and writes weights with their card; `shipped/` holds the
weights that come with the package. An observation row goes in, an action comes out, as
`baselines.deciders.decider` says.

May import: `hybrid_env`, `baselines.deciders`, `agents.interface`.
"""
