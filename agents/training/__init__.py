"""Training of agents into run folders: recipes, base classes of the algorithms, checkpoints and
learning curves.
"""
