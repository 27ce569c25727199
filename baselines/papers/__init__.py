"""Reproductions of the published tables, one module per paper.

Each states the settings and published values of its paper and has `reproduce(runs, seed)`, which returns a
`reproduction.Reproduction`. What only papers use lies with them: `adaptive` and `matrix_adaptive` have the
filters of Zimchuk & Kankin and the g-h filter.

May import: `hybrid_env` and all of `baselines`. Never `agents`.
"""
