"""Reading of recordings: CSV, TSV, Parquet, GPX and IGC files with pandas. `read.read_recordings`
is the entry. `files` finds the kind of a file by its content and makes its table of `cells`;
`columns` finds what its columns mean by their `names`. Cells become numbers and seconds, and
`positions` on a plane. `igc` reads flight logs. `modes` reads modes over time, true or stated, for
`hybridtrack score`.
"""
