"""Reproductions of the published tables, one module per paper, with settings and published values.
Each has `reproduce(runs, seed)`, which returns a `reproduction.Reproduction`. `adaptive` and
`matrix_adaptive` have the filters of Zimchuk & Kankin and the g-h filter. May import: `hybrid_env`
and all of `baselines`. Never `agents`.
"""
