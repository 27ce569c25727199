"""Learned deciders: training, evaluation and the comparison with the classical ones."""
