"""A search for hyper-parameters of a recipe with Optuna."""
