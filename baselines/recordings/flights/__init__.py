"""Recorded flights: reading, labels, and rules that state the mode of motion at every position.

`samples` reads the ADS-B reports of the package `traffic` where they are installed, `flight` cleans them and
says how good they are. `labels` finds the turns with a smoother that sees the whole flight. Rules read
`tracks`, whose rows are made by the filters `baselines.estimation.turns` or the semi-Markov posterior of
`turn_beam`; `metrics` compares the rules with the labels. `simulated` makes flights that look like the
recorded ones, and simulated twins of these. `semi_real` puts any of them into the setting of
`HybridTrackQuickest-v0`, for the deciders of that environment.

    samples = Samples()                                     # or a folder or wheel
    flights = [samples.flight("samu31:39ac45:0")]
    labels = label_flights(flights)
    batch = stack_flights(flights)                          # the pieces between gaps, as columns
    tracks = FlightTracks(batch, run_turn_imm(batch))
    stated = tracks.statements(FlightThresholdDecider(), [len(flight.times) for flight in flights])

May import: `hybrid_env`, `baselines.estimation`, `baselines.recordings`,
`baselines.rules`. Never `agents`.
"""
