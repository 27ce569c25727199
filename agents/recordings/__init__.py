"""Mode decisions on recordings of positions: `hybridtrack track`.

`tracking` has the options of tracking, deciders by name, the same as a function, and what is known of a recording
afterwards, row by row. `command` has the flags of files, works on many of them and writes everything, `figure`
draws. `gliders` lists the circles of a flight log.

May import: `hybrid_env`, `baselines`, and `interface`, `figures`, `learned`, `evaluation` and `training` of
`agents`; no other study.
"""
