"""Training algorithms of Stable-Baselines3 and sb3-contrib, one a file, with their
hyper-parameters.

An algorithm is a subclass of `agents.training.algorithm.Algorithm` and registers itself, see
`agents.learned.algorithm_names`.
"""
