"""Training of agents into run folders.

- `command`: `hybridtrack train`.
- `recipe`: reads `recipes/*.yml`; `settings`: the hyper-parameters of every algorithm, and their limits.
- `runs`: creates or resumes a run; `run`: base classes of all runs.
- `ppo`: agents of Stable-Baselines3; `vec_env`: the environment as its VecEnv.
- `anchor`, `anchor_stream`: the anchor agent, and the tracks that it decides on.
- `reward`: the agent that learns from rewards alone; `tandem`: MSPRT-TANDEM, `kalman`: KalmanNet, `distilled`:
  the shipped agent in a small network, `transformer`: attention over measurements, all on the same segments.
- `statements`: agents that are trained on the expected reward of their statements, on simulated tracks or
  on `simulated_flights` or `simulated_gliders`.
- `run_folder`: lock, config and metrics; `checkpoint`: the state of a run on disk.
- `learning_curve`: evaluation during training, and its plot.

May import: `hybrid_env`, `baselines`, and `interface`, `figures`, `learned` and `evaluation` of `agents`.
"""
