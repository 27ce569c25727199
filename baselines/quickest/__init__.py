"""Rules that state the present mode at every tick, for unknown switch moments, and the metrics of statements.

All rules have the `predict` of `baselines.deciders.decider.Decider` and read rows of
`hybrid_env.HybridTrackQuickestEnv`. `threshold` changes the statement when the probability of another mode is
large enough; `change_detection` has CUSUM, Shiryaev-Roberts and the windowed likelihood ratio. `beam` is the
threshold on the semi-Markov posterior, which `beam_filters` computes from the measurements; `beam_smoother`
has the posterior of earlier ticks. `statements` records a decider on fixed episodes, and `metrics` measures
what it recorded.

May import: `hybrid_env`, `baselines.deciders`. Never `agents`.
"""
