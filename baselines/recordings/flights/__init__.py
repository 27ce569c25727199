"""Recorded flights: reading, labels, and the environment in which rules state a mode at every
position.

`samples` reads the ADS-B reports of the package `traffic`, `flight` cleans them and says how good
they are. `labels` finds the turns with a smoother that sees the whole flight. `tracks` are flights
as an environment with unknown switches; `metrics` compares statements with the labels. `simulated`
makes flights that look like the recorded ones, and twins of these. Flights of gliders are read by
`gliders`, labelled by `circling` and simulated by `simulated_gliders`. `semi_real` puts any of them
into the setting of `HybridTrackQuickest-v0`. May import what `recordings` may.
"""
