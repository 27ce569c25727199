"""Reading of recordings: CSV, TSV, Parquet and GPX files with pandas.

`read.read_recordings` is the entry. A file becomes a table of cells, the table columns of numbers, and these
one `Recording` for each object.
"""
