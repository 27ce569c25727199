"""Learned deciders: networks (`*_net`), the deciders that they make (`*_decider`), or both in
one file.

`policy` is an actor of Stable-Baselines3, `exchange` reads those of other libraries, and
`policy_file` reads and writes weights and cards, such as those in `shipped*/`. All map observations
to actions as `baselines.rules.decider`.
"""
