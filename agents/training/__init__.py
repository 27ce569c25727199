"""Training of agents into run folders.

`recipe` reads hyper-parameters (`recipes/*.yml`); `runs` makes or resumes a run; `run` is what all runs
share, `ppo` and `sequence` the two kinds; `run_folder` holds config, checkpoint and metrics;
`learning_curve` and `learning_figure` show the progress. `vec_env` and `stopping_vec_env` are the
environments for Stable-Baselines3. `command` is `hybridtrack train`.

May import: `hybrid_env`, `baselines`, `agents.interface`, `agents.learned`, `agents.evaluation`.
"""
