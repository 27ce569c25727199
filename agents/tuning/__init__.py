"""Search for hyper-parameters of a recipe with Optuna: ranges and trials (`search`)."""
