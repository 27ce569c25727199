"""Learned deciders: inputs (`*_inputs`), networks (`*_net`), and the deciders that they make
(`*_decider`).

`policy` is an actor of Stable-Baselines3, `exchange` reads those of other libraries, and
`policy_file` reads and writes weights and cards, such as those in `weights`. All map observations
to actions as `baselines.rules.decider`.
"""
