"""Decision algorithms for recorded measurements, without an environment.

A recording (`recording`, read by `reading`) in its own units becomes uniform ticks (`ticks`), without outliers
(`scatter`). `model_fit` finds noise, radii and durations by maximum likelihood of the innovations, which `imm_pass`
computes on chunks of the recording side by side. `decisions` finds the first state and runs a decider over the ticks;
`consistency` says whether the model fits. A piece is a part of a recording between two gaps or switches. A chunk is
what is cut for a lane. `ate` decides the mode of each segment at known switch times as in the papers, with the
published bank on `arrays` of measured positions.

May import: `hybrid_env`, and `estimation`, `scoring` and `rules` of `baselines`. Never `baselines.papers` or `agents`.
"""
