"""Training of agents into run folders.

- `recipe`: hyper-parameters, read from `recipes/*.yml`.
- `runs`: creates or resumes a run.
- `run`: base class of all runs; `ppo` and `sequence` are its two kinds.
- `run_folder`: config, checkpoint and metrics.
- `learning_curve`, `learning_figure`: evaluation during training, and its plot.
- `vec_env`, `stopping_vec_env`: vectorised environments for Stable-Baselines3.
- `command`: `hybridtrack train`.

May import: `hybrid_env`, `baselines`, `agents.interface`, `agents.learned`, `agents.evaluation`.
"""
