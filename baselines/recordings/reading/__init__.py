"""Reading of recordings: CSV, TSV, Parquet and GPX files with pandas.

`read.read_recordings` is the entry. `files` finds the kind of a file by its content; `text`, `gpx` and Arrow
make its `table` of cells. `columns` finds what its columns mean by their `names`. `numbers`, `times` and
`positions` turn cells into seconds and positions on a plane, `projection` from latitude and longitude.
`objects` refuses several objects that no column tells apart. `summary` says in one line what was read.
"""
