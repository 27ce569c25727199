"""Decision algorithms for recorded and live measurements, without an environment.

A recording (`recording`, read by `reading`) becomes uniform ticks (`ticks`) without outliers
(`scatter`). `model_fit` finds noise, radii and durations by the likelihood that the bank of
`imm_pass` computes on chunks of the recording, one in each lane, and says whether this model fits;
`decisions` gives the rows to `tracker`, the decider on a live sensor, which returns an
`online_estimate` after each: `clock` has its ticks, `sensor_units` its units, `start` its first
estimate and its gate, `track_state` what it remembers, and `settings` what it takes from a
recording. A piece lies between two gaps or switches. May import: `hybrid_env`, and
`estimation`, `scoring` and `rules` of `baselines`.
"""
