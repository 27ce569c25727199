"""Reproductions of published tables, one file a paper with its settings and published values."""
