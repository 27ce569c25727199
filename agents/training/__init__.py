"""Training of agents into run folders: recipes, one run for each kind of loss (`runs.RUNS`), and
their checkpoints.
"""
