"""Mode decisions on recordings of positions: `hybridtrack track`.

`tracking` has the options of tracking, deciders by name, and the same as a function; `tracked` what is known
of a recording afterwards, row by row. `file_arguments` and `many_files` read files, `figure` and `html_map`
draw, `command` writes everything.

May import: `hybrid_env`, `baselines`, and `interface`, `figures`, `learned`, `evaluation` and `training` of
`agents`; no other study.
"""
