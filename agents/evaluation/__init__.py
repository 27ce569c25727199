"""Evaluation of deciders on fixed episodes.

- `deciders`: finds a decider by name and lists the thresholds to sweep.
- `evaluate`: runs a decider on the episodes of given seeds.
- `operating_curve`: sweeps the threshold of a decider.
- `statement_deciders`, `statement_curve`, `statement_table`, `evaluate_statements`: the same for unknown
  switch moments, where deciders state the mode at every tick.
- `cells`: estimates with their intervals in tables.
- `shifted_worlds`: evaluates deciders under distribution shift; `drawn_worlds`: random worlds.
- `seeds`: keeps the episodes of different purposes disjoint.
- `command`: `hybridtrack evaluate`.

May import: `hybrid_env`, `baselines`, `agents.interface`, `agents.learned`.
"""
