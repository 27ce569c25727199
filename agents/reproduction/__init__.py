"""Reproduction of published tables and figures: `hybridtrack reproduce`.

A paper is a study in `baselines.papers` and a file of the same name in `figures`, by which it is
found and which draws its figures.
"""
