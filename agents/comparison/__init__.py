"""Comparison of deciders on the same episodes: `hybridtrack compare`.

`command` defines the flags, `plan` holds the settings, `study` trains, sweeps and evaluates, `continuation`
keeps what an interrupted comparison has finished, `report` prints the tables, `tracks` notes one track with
two deciders, and `figures` draws it and the operating curves. The files `statement_*` are the same for
unknown switch moments, where deciders state the mode at every tick, and the files
`flights_*` for recorded flights (`baselines.recordings.flights`).

May import: `hybrid_env`, `baselines`, and `agents.interface`, `figures`, `learned`, `evaluation`, `training`;
no other study.
"""
