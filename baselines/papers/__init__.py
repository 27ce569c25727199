"""Reproductions of the published tables, one module per paper.

Each module states the settings and published values of its paper and has `reproduce(runs, seed)`, which
returns a `reproduction.Reproduction`: published and reproduced values, with the interval that a study of the
paper's size is expected to fall into. `switch_detection` is the detector of Golubkov 2020 on recordings, and
`adaptive` has filters that only a paper uses.

May import: `hybrid_env` and all of `baselines`. Never `agents`.
"""
