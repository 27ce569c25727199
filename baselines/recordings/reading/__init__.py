"""Reading of recordings: CSV, TSV, Parquet, GPX and IGC files. `read.read_recordings` is the entry.

`files` finds the kind of a file by its content and makes a `table` of its cells; `columns` finds
what its columns mean by their `names`; `values` makes numbers, angles and times of cells;
`cleaning` leaves out the rows that are no measurements of their own. `summary` says what was read.
`igc` reads flight logs, and `modes` reads modes over time for `hybridtrack score`.
"""
