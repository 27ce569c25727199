"""What is decided, and how that is scored.

- `task`: the base class of tasks, and the sweep over thresholds; `tasks` finds the task of an environment.
- `announced`, with the calibration of the bank, `unknown` and `flights`: the three kinds of tasks;
  `simulators` is the second one in simulators of others.
- `registry`: deciders by name, also agents in run folders. `curves`: what the figure of a comparison shows.
- `worlds`: options of other environments. `cells`: estimates in tables.

May import: `hybrid_env`, `baselines`, and `interface`, `figures` and `learned` of `agents`.
"""
