"""Reading of recordings: CSV, TSV, Parquet, GPX, TCX, KML, GeoJSON, NMEA, AIS and IGC files.
`read.read_recordings` is the entry.

`files` finds the kind of a file by its content and makes a `table` of its cells, `nested` those of
XML, JSON and NMEA; `columns` finds what its columns mean by their `names`; `values` makes numbers,
angles and times of cells, and `places` positions, whose axes point as `frames` says; `cleaning`
leaves out the rows that are no measurements of their own. `summary` says what was read. `igc` reads
flight logs, and `modes` reads modes over time for `hybridtrack score`.
"""
