"""Training of agents into run folders.

- `recipe`: hyper-parameters, read from `recipes/*.yml`.
- `statement_settings`, `learning_rate`: parts of a recipe.
- `runs`: creates or resumes a run.
- `run`: base class of all runs; `ppo` (with its two kinds in `ppo_runs`), `anchor` and `statements` (both are
  an `own_network_run`).
- `flights`: trains the agent for recorded flights, a program of its own.
- `statement_reward`: the expected reward of random statements, which `statements` trains on.
- `anchor_stream`, `sample_buffer`: the tracks and the samples of the anchor agent.
- `run_folder`: lock, config and metrics.
- `checkpoint`: the state of a run on disk; `track_state` and `random_state` are parts of it.
- `learning_curve`, `statement_learning_curve`, `learning_figure`: evaluation during training, and its plot.
- `vec_env`: the vectorised environment for Stable-Baselines3.
- `command`: `hybridtrack train`.

May import: `hybrid_env`, `baselines`, `agents.interface`, `agents.learned`, `agents.evaluation`.
"""
