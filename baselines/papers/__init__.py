"""The published tables, one file a paper, and how a reproduction is judged.

Each paper's file states its settings and its published figures and has `reproduce(runs, seed)`, which
returns the tables of `reproduction`: published and measured cells, with the interval of a study of the
paper's size.

May import: `hybrid_env` and all of `baselines`. Never `agents`.
"""
