"""Learned deciders, their training, and the studies that compare them with the classical rules.

The subpackages, lowest first. Each imports only those listed before it, and a study never another study:

1. `interface`: what every command shares: flags of the world, progress display, output files.
2. `figures`: what the figures of all studies share: panels of curves, timelines, colours, labels.
3. `learned`: networks and policies as deciders, their files, and the shipped weights.
4. `evaluation`: deciders by name, measured on fixed episodes; operating curves; shifted worlds.
5. `training`: recipes, runs and run folders, the Stable-Baselines3 VecEnv.
6. one subpackage per study, with its command, plan, report and figures: `comparison`, `limits`,
   `reproduction`, `benchmark`, `recordings`, `playing`, `tuning`.
7. `cli`: the console script, which knows every command.
"""
