"""Tracks of simulators that others wrote, in place of the object of the environments.

`aircraft` flies the aircraft of JSBSim by a commanded bank, which is the true mode; `tracks` adds noise to
the positions and gives them to the bank of `HybridTrackQuickest-v0`, so that its deciders, rollout and
figures serve as they are. Everything is generated from seeds.

May import: `hybrid_env`, and `estimation`, `scoring`, `rules` and `recordings` of `baselines`. Never
`agents`.
"""
