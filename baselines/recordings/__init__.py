"""Decision algorithms for recorded measurements, without an environment.

A recording (`recording`, read by `reading`) in its own units becomes uniform ticks (`ticks`), without
outliers (`scatter`). `model_fit` finds noise, radii and durations by maximum likelihood of the innovations,
which `imm_pass` computes on `parts` of the recording side by side. `decisions` runs a decider over the ticks,
from the state that `first_state` finds; `consistency` says whether the model fits.

`ate` is adaptive trajectory estimation, which decides the mode of each segment at known switch times.
`change_detection` detects a switch at an unknown time. Both are those of the papers: they apply the published
bank to arrays of measured positions.

May import: `hybrid_env`, `baselines.estimation`, `baselines.rules`. Never
`baselines.papers` or `agents`.
"""
