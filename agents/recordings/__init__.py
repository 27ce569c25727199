"""Mode decisions on recordings of positions: `hybridtrack track`.

`tracking` has the options of tracking, deciders by name, and the same as a function; `tracked` what is known
of a recording afterwards, row by row. `files` has the flags of files and works on many of them, `figure`
draws, `command` writes everything. `gliders` lists the circles of a flight log.

May import: `hybrid_env`, `baselines`, and `interface`, `figures`, `learned`, `evaluation` and `training` of
`agents`; no other study.
"""
