"""Tracks of simulators that others wrote, in place of the object of the environments.

- `paths`: what every simulator gives. `aircraft` flies the aircraft of JSBSim by a commanded bank,
  `airliners` those of BlueSky by commanded headings; the command is the true mode. `cars` drives
  the cars of SUMO on road nets, and their yaw rate is the true mode.
- `tracks`: adds noise to the positions and gives them to the bank of `HybridTrackQuickest-v0`, so
  that its deciders, rollout and figures serve as they are. `process_noise`: chooses among banks by
  their evidence.
- `inexact`: objects of our own that move otherwise than told, for the training of an agent.

Everything is generated from seeds.

May import: `hybrid_env`, and `estimation`, `scoring`, `rules` and `recordings` of `baselines`.
Never `agents`.
"""
