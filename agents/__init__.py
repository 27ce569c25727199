"""Learned deciders, their training, and the studies that compare them with the classical rules.

The subpackages, lowest first. Each imports only those listed before it, and a study never another study:

1. `interface`: what every command shares: flags of the options, progress display, output files.
2. `figures`: what the figures of all studies share: panels of curves, timelines, colours, labels.
3. `learned`: networks and policies as deciders, their files, and the shipped weights.
4. `evaluation`: tasks, deciders by name, and the sweep that gives their scores.
5. `training`: recipes, runs and run folders, the Stable-Baselines3 VecEnv.
6. `studies`: `evaluate`, `compare`, `limits` and `play` as lists of tasks, deciders and options.
7. one subpackage per further command: `reproduction`, `recordings`, `tuning`, `league`.
8. `functions`: `load`, `evaluate`, `compare` and `train` for Python, loaded when they are first used; `cli`:
   the commands.
"""

from hybrid_env.extras import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__)
