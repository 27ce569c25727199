"""Rules that state the present mode at every tick, for unknown switch moments, and the metrics of statements.

All rules have the `predict` of `baselines.rules.decider.Decider`. Two files have rules that read rows of
`hybrid_env.HybridTrackQuickestEnv`: `threshold` changes the statement when the probability of another mode is
large enough; `change_detection` has CUSUM and Shiryaev-Roberts. The others filter the measurements themselves
(`measurements`): `restarted` has the windowed generalized likelihood ratio and the detector of Golubkov 2020,
which start filters at every tick (`restarted_filters`); `beam` is the threshold on the semi-Markov posterior,
which `beam_filters` computes; `beam_smoother` has the posterior of earlier ticks. `statements` records a
decider on fixed episodes, and `metrics` measures what it recorded.

May import: `hybrid_env`, `baselines.rules`. Never `agents`.
"""
