"""Decision algorithms for recorded measurements, without an environment.

A recording (`recording`, read by `reading`) becomes uniform ticks (`ticks`) without outliers
(`scatter`). `model_fit` finds noise, radii and durations by the likelihood that the bank of
`imm_pass` computes on chunks of the recording, one in each lane, and says whether this model fits;
`decisions` runs a decider over the ticks. A piece lies between two gaps or switches. `ate` decides
the segments between known switches as in the papers, with the published bank on arrays of
positions; `given_tracks` puts given paths in place of the object of an environment. May import:
`hybrid_env`, and `estimation`, `scoring` and `rules` of `baselines`.
"""
