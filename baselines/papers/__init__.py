"""Reproductions of the published tables, one module per paper.

Each module states the settings and published values of its paper and has `reproduce(runs, seed)`, which
returns a `reproduction.Reproduction`: published and reproduced values, with the interval that a study of the
paper's size is expected to fall into.

May import: `hybrid_env` and all of `baselines`. Never `agents`.
"""
