"""Reproductions of the published tables, one module per paper.

Each module states the settings and published values of its paper and has `reproduce(runs, seed)`, which
returns a `reproduction.Reproduction`: published and reproduced values, with the interval that a study of the
paper's size is expected to fall into. What only a paper uses lies with it: Golubkov 2018 has the filter that
knows the modes, Golubkov 2020 its detector; `adaptive` and `matrix_adaptive` have the
filters of Zimchuk & Kankin and the g-h filter.

May import: `hybrid_env` and all of `baselines`. Never `agents`.
"""
