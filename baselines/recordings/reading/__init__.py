"""Reading of recordings: CSV, TSV, Parquet, GPX and IGC files with pandas.

`read.read_recordings` is the entry, and says in one line what was read. `files` finds the kind of a file by its content
and makes its table of `cells`. `columns` finds what its columns mean by their `names`. `cells` become numbers and
seconds, `positions` those on a plane. `igc` reads the positions of flight logs. `modes` reads modes over time, true or
stated, for `hybridtrack score`.
"""
